// What the program was built with, read from the program itself, and from the commands that made
// it.
#include <elf.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/source_dir.h"

namespace unfurl::cli::hardening_test {
namespace {

using ::testing::HasSubstr;

// A 64-bit ELF file: what of it the tests look at.
class Elf {
 public:
  explicit Elf(const std::string& path) {
    std::ifstream stream(path, std::ios::binary);
    std::ostringstream all;
    all << stream.rdbuf();
    bytes_ = all.str();
    if (bytes_.size() < sizeof header_ || bytes_.compare(0, SELFMAG, ELFMAG) != 0) return;
    std::memcpy(&header_, bytes_.data(), sizeof header_);
    for (std::size_t k = 0; k < header_.e_phnum; ++k) {
      segments.push_back(At<Elf64_Phdr>(header_.e_phoff + k * sizeof(Elf64_Phdr)));
    }
    std::vector<Elf64_Shdr> sections;
    for (std::size_t k = 0; k < header_.e_shnum; ++k) {
      sections.push_back(At<Elf64_Shdr>(header_.e_shoff + k * sizeof(Elf64_Shdr)));
    }
    for (const Elf64_Shdr& section : sections) {
      if (section.sh_type == SHT_DYNAMIC) {
        for (std::size_t at = 0; at < section.sh_size; at += sizeof(Elf64_Dyn)) {
          dynamic.push_back(At<Elf64_Dyn>(section.sh_offset + at));
        }
      }
      if (section.sh_type == SHT_DYNSYM) {
        const std::size_t names = sections.at(section.sh_link).sh_offset;
        for (std::size_t at = 0; at < section.sh_size; at += sizeof(Elf64_Sym)) {
          const auto symbol = At<Elf64_Sym>(section.sh_offset + at);
          if (symbol.st_shndx == SHN_UNDEF) imports.insert(bytes_.c_str() + names + symbol.st_name);
        }
      }
    }
  }

  int type() const { return header_.e_type; }
  const Elf64_Phdr* Segment(unsigned kind) const {
    for (const Elf64_Phdr& segment : segments) {
      if (segment.p_type == kind) return &segment;
    }
    return nullptr;
  }
  std::uint64_t Dynamic(std::int64_t tag) const {
    for (const Elf64_Dyn& entry : dynamic) {
      if (entry.d_tag == tag) return entry.d_un.d_val;
    }
    return 0;
  }

  std::vector<Elf64_Phdr> segments;
  std::vector<Elf64_Dyn> dynamic;
  std::set<std::string> imports;  // names of functions and data of others

 private:
  template <typename T>
  T At(std::size_t offset) const {
    T value{};
    if (offset + sizeof value <= bytes_.size()) {
      std::memcpy(&value, bytes_.data() + offset, sizeof value);
    }
    return value;
  }
  std::string bytes_;
  Elf64_Ehdr header_{};
};

class Hardening : public ::testing::TestWithParam<const char*> {};

TEST_P(Hardening, RelocationsAreReadOnlyBeforeMain) {
  const Elf elf(GetParam());
  EXPECT_NE(elf.Segment(PT_GNU_RELRO), nullptr);
  EXPECT_TRUE((elf.Dynamic(DT_FLAGS) & DF_BIND_NOW) != 0 ||
              (elf.Dynamic(DT_FLAGS_1) & DF_1_NOW) != 0)
      << "relocations are bound lazily: the table of functions stays writable";
}

TEST_P(Hardening, NothingIsWritableAndRun) {
  const Elf elf(GetParam());
  ASSERT_NE(elf.Segment(PT_GNU_STACK), nullptr);
  EXPECT_EQ(elf.Segment(PT_GNU_STACK)->p_flags & PF_X, 0u);
  for (const Elf64_Phdr& segment : elf.segments) {
    if (segment.p_type != PT_LOAD) continue;
    EXPECT_NE(segment.p_flags & (PF_W | PF_X), unsigned{PF_W | PF_X});
  }
}

TEST_P(Hardening, LiesAtRandomAddresses) {
  const Elf elf(GetParam());
  EXPECT_EQ(elf.type(), ET_DYN);
  const bool program = elf.Segment(PT_INTERP) != nullptr;
  EXPECT_TRUE(!program || (elf.Dynamic(DT_FLAGS_1) & DF_1_PIE) != 0);
}

TEST_P(Hardening, GuardsItsStackAndItsBuffers) {
  const Elf elf(GetParam());
  EXPECT_TRUE(elf.imports.contains("__stack_chk_fail"));
  int fortified = 0;
  for (const std::string& name : elf.imports) {
    if (name.starts_with("__") && name.ends_with("_chk")) ++fortified;
  }
  EXPECT_GT(fortified, 0) << "no call of a checked function, as __memcpy_chk";
}

INSTANTIATE_TEST_SUITE_P(Built, Hardening, ::testing::Values(UNFURL_PROGRAM, UNFURL_LIBRARY),
                         [](const auto& test) { return test.index == 0 ? "Program" : "Library"; });

// The room that a source is of: none for those of tests, examples and what is made.
bool IsOfARoom(const std::string& file) {
  const std::string root = UNFURL_SOURCE_DIR "/";
  if (!file.starts_with(root)) return false;
  const std::string folder = file.substr(root.size(), file.find('/', root.size()) - root.size());
  return folder != "tests" && folder != "bench" && folder != "examples" && folder != "build" &&
         folder != "docs";
}

// What one command compiles: the source itself, or those that are compiled together as one.
std::vector<std::string> SourcesOf(const std::string& file) {
  const std::filesystem::path path(file);
  if (!path.filename().string().starts_with("unity_")) return {file};
  std::vector<std::string> sources;
  std::ifstream stream(path);
  for (std::string line; std::getline(stream, line);) {
    if (!line.starts_with("#include \"")) continue;
    const auto begin = line.find('"') + 1;
    sources.push_back(line.substr(begin, line.rfind('"') - begin));
  }
  return sources;
}

// One object that was made otherwise does not show in the whole.
TEST(HardeningCommands, EverySourceOfARoomIsMadeSo) {
  std::ifstream stream(UNFURL_COMMANDS);
  const auto commands = nlohmann::json::parse(stream);
  std::ptrdiff_t sources = 0;
  for (const auto& entry : commands) {
    const std::string file = entry.at("file"), command = entry.at("command");
    const auto of_rooms = std::ranges::count_if(SourcesOf(file), IsOfARoom);
    if (of_rooms == 0) continue;
    sources += of_rooms;
    SCOPED_TRACE(file);
    EXPECT_THAT(command, HasSubstr(" -fstack-protector-strong"));
    EXPECT_THAT(command, HasSubstr(" -fstack-clash-protection"));
    EXPECT_THAT(command, HasSubstr(" -fPI"));
    EXPECT_EQ(command.find(" -fno-stack"), std::string::npos);
    if (command.find(" -O") != std::string::npos && command.find(" -O0") == std::string::npos) {
      EXPECT_THAT(command, HasSubstr(" -D_FORTIFY_SOURCE=" UNFURL_FORTIFY));
    }
  }
  EXPECT_GT(sources, 200);
}

}  // namespace
}  // namespace unfurl::cli::hardening_test
