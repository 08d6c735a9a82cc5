#pragma once

#include <toml++/toml.h>

#include <string>
#include <vector>

#include "data/toml.h"

namespace unfurl::data {

// What a dotted key names in a document is set to another value; tables that are not there are
// made, "key[2]" must be there. Both give the node whose readers are to name the override in their
// errors: the value, or the whole array of which an item was set. Both throw Error, placed at
// "--set KEY".

// "dotted.key=value", the value in TOML; a bare word is a string. "dotted.key=" takes the key away,
// which must be there; null then. `dotted` gets the key.
const toml::node* ApplyOverride(toml::table& root, const std::string& assignment,
                                std::string* dotted);

// A number without a fraction becomes a whole number, which every reader of numbers takes.
const toml::node* SetNumber(toml::table& root, const TomlDocument::Value& value);

// The document at `path` with these overrides as TOML, without comments, in the order of its keys;
// what it includes is in it.
std::string TextWithOverrides(const std::string& path, const std::vector<std::string>& overrides);

}  // namespace unfurl::data
