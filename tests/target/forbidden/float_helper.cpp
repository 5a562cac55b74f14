// Has what check_image.py must find: a multiplication by the compiler's helper.
volatile float factor = 2;
int main() {
    factor = factor * factor;
}
