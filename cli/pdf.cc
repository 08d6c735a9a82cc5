#include "cli/pdf.h"

#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <vector>

#include "base/error.h"
#include "base/subprocess.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/scratch_folder.h"

namespace unfurl::cli {

namespace {

namespace fs = std::filesystem;

// A path as part of an address: what is not a plain letter becomes %XX.
std::string AddressOf(const std::string& path) {
  constexpr char kHex[] = "0123456789ABCDEF";
  std::string out = "file://";
  for (const char c : fs::absolute(path).lexically_normal().string()) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
                       c == '/' || c == '-' || c == '_' || c == '.' || c == '~';
    if (plain) {
      out += c;
    } else {
      out += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return out;
}

}  // namespace

std::string FindPrinter() {
  const char* path = std::getenv("PATH");
  for (const char* name : {"chromium", "chromium-browser", "google-chrome"}) {
    for (const std::string& folder : Split(path != nullptr ? path : "", ':')) {
      std::string program = (folder.empty() ? "." : folder) + "/" + name;
      if (access(program.c_str(), X_OK) == 0 && !fs::is_directory(program)) return program;
    }
  }
  throw Error("no Chromium on this machine to print with", "--pdf",
              "install it (apt install chromium), or print the page of --report from any browser",
              ErrorKind::kMachine);
}

void PrintPage(const std::string& browser, const std::string& page, const std::string& pdf) {
  const data::ScratchFolder scratch("unfurl-print-");
  const std::string printed = scratch.File("page.pdf"), errors = scratch.File("errors");
  std::vector<std::string> words = {
      browser,
      "--headless=new",
      "--disable-gpu",
      "--disable-dev-shm-usage",
      "--no-pdf-header-footer",
      "--user-data-dir=" + scratch.File("profile"),
      "--print-to-pdf=" + printed,
      AddressOf(page),
  };
  // Root has no sandbox; the page is our own and may fetch nothing.
  if (geteuid() == 0) words.insert(words.begin() + 1, "--no-sandbox");
  constexpr double kLongest = 120.0;  // a page of the largest size takes some seconds [s]
  const ProgramOutcome outcome =
      RunProgram(words, scratch.path(), scratch.File("out"), errors, kLongest);
  std::error_code missing;
  if (outcome.code != 0 || fs::file_size(printed, missing) == 0 || missing) {
    throw Error(outcome.timed_out ? "the browser did not end"
                                  : "the browser did not print: " + data::LastLineOf(errors),
                browser, "print the page of --report from a browser by hand", ErrorKind::kMachine);
  }
  data::WriteTextFile(pdf, data::ReadTextFile(printed));
}

}  // namespace unfurl::cli
