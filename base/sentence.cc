#include "base/sentence.h"

#include <algorithm>
#include <cctype>

namespace unfurl {

std::string Capitalised(std::string words) {
  constexpr std::size_t kShortestWord = 3;  // letters: symbols have one or two
  // "a" and "no" are words, too.
  const std::string first = words.substr(0, words.find_first_of(" ,:;."));
  const bool short_word = first == "a" || first == "an" || first == "no" || first == "of" ||
                          first == "in" || first == "at" || first == "by" || first == "it";
  const bool word = short_word || (first.size() >= kShortestWord &&
                                   std::all_of(first.begin(), first.end(),
                                               [](char c) { return c >= 'a' && c <= 'z'; }));
  if (word) words[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(words[0])));
  return words;
}

}  // namespace unfurl
