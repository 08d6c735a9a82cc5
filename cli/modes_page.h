#pragma once

#include <string>
#include <vector>

#include "data/modes.h"
#include "data/provenance.h"

namespace unfurl::cli {

/// A header and a row a mode, for terminal and page.
std::vector<std::vector<std::string>> ModeRows(const data::ModesRecord& record);

/// The page of `unfurl modes`: a table, and each mode's shape in motion. `scene` is its name;
/// `words` say about which state, one line each.
struct ModesPageInput {
  const data::ModesRecord& record;
  std::string scene;
  std::vector<std::string> words;
  bool usable = true;
};
void WriteModesPage(const std::string& path, const ModesPageInput& input,
                    const data::Provenance& provenance);

}  // namespace unfurl::cli
