// Has what check_image.py must find: memory from the heap.
#include <cstdlib>
extern "C" void* _sbrk(int) {
    return nullptr;
}
void* volatile memory;
int main() {
    memory = std::malloc(16);
}
