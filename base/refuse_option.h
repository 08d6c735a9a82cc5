#pragma once

#include <string>
#include <utility>

#include "base/error.h"

namespace unfurl {

/// Refuses the fields of one Options struct, from its Check(): Error "STRUCT::field: WHAT; REMEDY".
class RefuseOption {
 public:
  explicit RefuseOption(std::string type) : type_(std::move(type)) {}
  [[noreturn]] void operator()(const char* field, const std::string& what,
                               const char* remedy = "give a number that makes sense") const {
    throw Error(what, type_ + "::" + field, remedy);
  }

 private:
  std::string type_;
};

}  // namespace unfurl
