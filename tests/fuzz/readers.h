#pragma once

#include <functional>
#include <string>
#include <vector>

namespace unfurl::fuzz {

// A reader of files, as a target: it takes any bytes, and either reads them or throws Error. All
// else (another exception, a fault, a sanitizer's complaint, no end) is a defect.
struct Reader {
  std::string name;
  std::function<void(const std::string& path)> read;
};

const std::vector<Reader>& Readers();

// The bytes as a file in memory, given to the reader. False where it refused them.
bool Try(const Reader& reader, const std::string& bytes);

}  // namespace unfurl::fuzz
