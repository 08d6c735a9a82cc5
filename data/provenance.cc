#include "data/provenance.h"

#include <sha256.h>

#include <cerrno>
#include <cstring>

#include "base/error.h"

namespace unfurl::data {

std::string FileSha256(const std::string& path) {
  char hex[SHA256_DIGEST_STRING_LENGTH];
  if (SHA256File(path.c_str(), hex) == nullptr) {
    throw Error(std::string("cannot read: ") + std::strerror(errno), path, "check the name");
  }
  return hex;
}

void Provenance::AddInput(const std::string& path) { inputs.push_back({path, FileSha256(path)}); }

std::string ProgramVersion() { return "unfurl " UNFURL_VERSION; }

}  // namespace unfurl::data
