// Loaded before the program (LD_PRELOAD): puts the environment's locale in force, for C and for C++
// streams, as a program does that links the library.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <clocale>
#include <locale>

namespace {

__attribute__((constructor)) void Localize() {
  const char* found = std::setlocale(LC_ALL, "");
  if (found == nullptr || strcmp(std::localeconv()->decimal_point, ",") != 0) {
    fprintf(stderr, "no such locale\n");
    return;
  }
  std::locale::global(std::locale(""));
}

}  // namespace
