#pragma once

#include <string>
#include <utility>

#include "base/error.h"
#include "data/toml.h"

namespace unfurl::data {

// What a document is by the tables that it has: "scene", "study", "campaign", "raw lines", "lab";
// "TOML": none of them.
std::string KindOfDocument(const TomlTable& root);

// "a laboratory", of a kind.
std::string KindWords(const std::string& kind);

// Throws Error where the document is known to be of another kind than the `wanted` one.
void RequireKind(const TomlTable& root, const std::string& wanted);

// What was thrown while `root` was read, with the table that stands there under nearly the name of
// one that was looked for: its keys are what is missing.
Error WithMisspeltTable(const Error& error, const TomlTable& root);

// What `read` makes of the document as a file of the `wanted` kind.
template <typename Read>
auto ReadAsKind(const TomlTable& root, const std::string& wanted, Read read) {
  RequireKind(root, wanted);
  try {
    return read();
  } catch (const Error& error) {
    throw WithMisspeltTable(error, root);
  }
}

}  // namespace unfurl::data
