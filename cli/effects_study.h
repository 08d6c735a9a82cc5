#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "cli/verb.h"
#include "study/effects.h"

namespace unfurl::cli {

/// What `unfurl effects` was asked.
struct EffectsArguments {
  std::string input, out, report, sigma, rival;
  std::vector<std::string> sets;
  double part = 0.3, duration = 0.0, budget = 0.5;
  bool each = false;
  std::size_t workers = 0;
};

/// What each kind of input comes to.
struct EffectsTold {
  bool usable = true;     // the study's fit
  std::string message;    // of one that is not
  bool explained = true;  // a study's data, by its model or by the best of the rivals
  std::string head, closing;
  std::string headline;                        // of a page; empty: the closing
  std::string title, note;                     // of the table; the note on a page only
  std::vector<std::vector<std::string>> rows;  // the first is the header
  std::vector<int> text_columns;               // of them
  nlohmann::ordered_json json;
  std::vector<std::string> set;  // of the reduced scene
  std::string scene;             // that it is made from; empty: there is none
  std::string left_out;          // in words
  std::vector<std::string> scene_sets;
};

/// "without" of an effect that is there, "with" of one that is not.
std::string EffectLabel(const study::EffectSwitch& effect);
/// "can be left out: ..."
std::string LeftOutWords(const std::vector<std::string>& names);

/// Of a study: each effect, the parameters fitted again. Throws Error.
EffectsTold EffectsOfStudy(const Common& common, const EffectsArguments& a);
/// Of a study and its rival. Throws Error.
EffectsTold EffectsOfRivals(const Common& common, const EffectsArguments& a);

}  // namespace unfurl::cli
