#pragma once

#include <string>

namespace unfurl::cli {

// A Chromium along PATH. Throws Error (the machine's) where there is none.
std::string FindPrinter();

// Prints a page into `pdf`, whole or not at all. Throws Error (the machine's) where the browser
// does not do it, with its own words.
void PrintPage(const std::string& browser, const std::string& page, const std::string& pdf);

}  // namespace unfurl::cli
