#pragma once

#include <string>

namespace unfurl {

// The words as a sentence begins: with a capital, but for a name that may be a symbol, since k or
// m_2 is no K.
std::string Capitalised(std::string words);

}  // namespace unfurl
