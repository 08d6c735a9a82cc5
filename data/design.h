#pragma once

#include <string>
#include <vector>

#include "data/study.h"

namespace unfurl::data {

/// A mark that could be put on the structure.
struct DesignMark {
  std::string name;
  std::vector<std::string> set;  ///< overrides of the scene that put it there
  std::string where;             ///< file:line:key, for messages
};

/// An instrument that could be added: as a study's channel, without a file.
struct DesignChannel {
  StudyChannel channel;  ///< its sigma is positive; its window is on the tracks' clock
  double rate = 0.0;     ///< of its readings [1/s]
};

/// A trial that could be run next.
struct DesignTrial {
  std::string name;
  std::vector<std::string> set;  ///< overrides of the scene
  std::string where;             ///< file:line:key, for messages
};

/// What could be measured next, as a person wrote it; every key is in docs/design.md.
struct Design {
  std::string path;
  std::vector<DesignMark> marks;
  std::vector<DesignChannel> channels;
  std::vector<DesignTrial> trials;
};

/// Throws Error (file:line:key).
Design ReadDesign(const std::string& path, const std::vector<std::string>& overrides = {});
/// The same of a text.
Design ParseDesign(const std::string& text, const std::string& name);

}  // namespace unfurl::data
