// The C++ part of faults.c: the linker hands it the library's operator new.
#include <cstddef>
#include <new>

extern "C" {
bool faults_new_fails(void);
void *__real__Znwm(std::size_t size);
void *__wrap__Znwm(std::size_t size);

void *__wrap__Znwm(std::size_t size) {
    if (faults_new_fails())
        throw std::bad_alloc();
    return __real__Znwm(size);
}
}
