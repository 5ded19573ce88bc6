// What Debian's archives of OpenCV and LAPACK name and nothing calls, so that OpenGL and Fortran's
// runtime stay away.
#include <stddef.h>
#include <stdio.h>

// OpenCV's buffers of OpenGL: no function of OpenGL is there.
void* glXGetProcAddressARB(const unsigned char* name) {
  (void)name;
  return NULL;
}

// LAPACK's and BLAS's word on a wrong argument. Theirs end the process; OpenCV reads `info`.
void xerbla_(const char* name, const int* argument, size_t name_length) {
  fprintf(stderr, "LAPACK's %.*s: argument %d\n", (int)name_length, name, *argument);
}
void cblas_xerbla(int argument, const char* name, const char* form, ...) {
  (void)form;
  fprintf(stderr, "BLAS's %s: argument %d\n", name, argument);
}

// Fortran's `first // second`: LAPACK's key to a block size, of a few letters.
void _gfortran_concat_string(size_t length, char* to, size_t first_length, const char* first,
                             size_t second_length, const char* second) {
  for (size_t i = 0; i < length; ++i) {
    to[i] = i < first_length                   ? first[i]
            : i < first_length + second_length ? second[i - first_length]
                                               : ' ';
  }
}
