// Has what check_image.py must find: compiled for a floating-point unit, a multiplication by instruction.
volatile float factor = 2;
int main() {
    factor = factor * factor;
}
