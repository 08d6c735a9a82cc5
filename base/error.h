#pragma once

#include <stdexcept>
#include <string>

namespace unfurl {

// What the person running the program, or calling the library, can mend. Numerical outcomes are
// not errors: they are returned as data. Broken invariants of ours are assertions.
enum class ErrorKind {
  kBadInput,  // the input or its use is wrong; exit code 2
  kMachine,   // the machine refused: disk full, no permission; exit code 4
};

// One line: WHERE: WHAT; REMEDY. `where` is file:line:key, as far as known.
class Error : public std::runtime_error {
 public:
  // `what` states the fault, `where` the place, `remedy` what to do about it; each without a full
  // stop.
  Error(const std::string& what, const std::string& where, const std::string& remedy,
        ErrorKind kind = ErrorKind::kBadInput);

  // Who must act: the person, or the machine's owner.
  ErrorKind kind() const { return kind_; }
  /// The parts of the line, each without the others; `where` and `remedy` may be empty.
  const std::string& problem() const { return problem_; }
  const std::string& where() const { return where_; }
  const std::string& remedy() const { return remedy_; }

 private:
  ErrorKind kind_;
  std::string problem_, where_, remedy_;
};

// Thrown where long work notices that Ctrl-C was pressed; exit code 130.
class Interrupted : public std::runtime_error {
 public:
  Interrupted() : std::runtime_error("interrupted") {}
};

// Exit codes of the program, documented in docs/formats.md.
enum ExitCode : int {
  kExitGood = 0,
  kExitNotUsable = 1,  // ran, but the result is not usable
  kExitBadInput = 2,
  kExitFault = 3,  // internal error
  kExitMachine = 4,
  kExitInterrupted = 130,
};

}  // namespace unfurl
