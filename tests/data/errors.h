#pragma once

#include <string>

#include "base/error.h"

namespace unfurl::data {

// The message of the Error that f throws.
template <typename F>
std::string ErrorOf(F&& f) {
  try {
    f();
  } catch (const Error& e) {
    return e.what();
  }
  return "no error";
}

}  // namespace unfurl::data
