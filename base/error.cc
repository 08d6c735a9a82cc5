#include "base/error.h"

namespace unfurl {

namespace {

std::string Compose(const std::string& what, const std::string& where, const std::string& remedy) {
  std::string line = where.empty() ? what : where + ": " + what;
  if (!remedy.empty()) line += "; " + remedy;
  for (char& c : line) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  return line;
}

}  // namespace

Error::Error(const std::string& what, const std::string& where, const std::string& remedy,
             ErrorKind kind)
    : std::runtime_error(Compose(what, where, remedy)),
      kind_(kind),
      problem_(what),
      where_(where),
      remedy_(remedy) {}

}  // namespace unfurl
