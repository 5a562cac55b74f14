// Has what check_image.py must find: run-time type information.
#include <typeinfo>
struct Base {
    virtual int value() { return 1; }
};
const char* volatile name;
Base base;
int main() {
    name = typeid(base).name();
}
