// Has what check_image.py must find: two functions that call each other.
volatile int depth = 10;
int odd(int n);
[[gnu::noipa]] int even(int n) {
    return n == 0 ? depth : odd(n - 1) + depth;
}
[[gnu::noipa]] int odd(int n) {
    return n == 0 ? 0 : even(n - 1) + depth;
}
int main() {
    depth = even(depth);
}
