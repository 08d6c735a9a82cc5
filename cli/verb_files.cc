#include "cli/verb_files.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <stdexcept>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "cli/pdf.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/inputs.h"
#include "data/toml.h"
#include "data/toml_files.h"

namespace unfurl::cli {

std::string MadeByWords(const std::string& verb) { return "made by `unfurl " + verb; }

namespace {

namespace fs = std::filesystem;

constexpr char kInput[] = "FILE", kOutput[] = "NEW_FILE", kFolder[] = "FOLDER",
               kOverride[] = "KEY=VALUE";

// What identifies a file, whatever its names: device and inode, or for one that is not
// there yet those of its folder, and its name.
std::string IdentityOf(const std::string& path) {
  struct stat info = {};
  if (stat(path.c_str(), &info) == 0) return fmt::format("{}:{}", info.st_dev, info.st_ino);
  std::error_code ignored;
  const fs::path whole = fs::weakly_canonical(fs::absolute(path, ignored), ignored);
  if (stat(whole.parent_path().c_str(), &info) != 0) return whole.string();
  return fmt::format("{}:{}/{}", info.st_dev, info.st_ino, whole.filename().string());
}

// Tells a file from the one that takes its place; empty: there is none.
std::string VersionOf(const std::string& path) {
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0) return {};
  return fmt::format("{}:{}:{}.{}", info.st_dev, info.st_ino, info.st_mtim.tv_sec,
                     info.st_mtim.tv_nsec);
}

// What is written on the way to an output (AtomicFile, Journal), and itself.
std::vector<std::string> WrittenFor(const std::string& path) {
  return {path, path + ".partial", path + ".partial~", path + ".partial.new"};
}

// HDF5 files say so in their provenance; texts near their beginning.
bool MadeBy(const std::string& path, const std::string& verb) {
  std::error_code ignored;
  if (!fs::is_regular_file(path, ignored)) return false;
  std::array<char, 512> head{};
  std::ifstream(path, std::ios::binary).read(head.data(), head.size());
  if (std::string_view(head.data(), head.size()).find(MadeByWords(verb)) != std::string::npos) {
    return true;
  }
  bool made = false;
  try {
    const data::H5Reader file(path, data::H5Reader::SchemaOf(path),
                              std::numeric_limits<int>::max());
    made = file.ReadProvenance().command.starts_with("unfurl " + verb + " ");
  } catch (const Error&) {
  }
  data::ForgetInput(path);  // was looked at, and may be replaced
  return made;
}

// Forms that people know by their endings; a file of another form under such a name is opened by
// the wrong program, or by none.
constexpr std::array<std::string_view, 18> kKnownEndings = {
    ".h5",  ".hdf5", ".csv", ".tsv", ".txt",  ".xlsx", ".mat", ".toml", ".html",
    ".htm", ".pdf",  ".png", ".jpg", ".jpeg", ".json", ".svg", ".c3d",  ".uff"};

// Throws Error where the name says another form than the one that is written, `own`.
void CheckEnding(const std::string& option, const std::string& path,
                 const std::vector<std::string_view>& own, const std::string& remedy) {
  const std::string ending = data::EndingOf(path);
  if (std::find(own.begin(), own.end(), ending) != own.end() ||
      std::find(kKnownEndings.begin(), kKnownEndings.end(), ending) == kKnownEndings.end()) {
    return;
  }
  throw Error(fmt::format("{} writes {}, and the name says {}", option, own.front(), ending), path,
              remedy);
}

// Throws Error where a file cannot be written, as far as that can be told before the work.
void CheckPlace(const std::string& option, const std::string& path) {
  std::error_code ignored;
  const std::string parent = fs::path(path).parent_path().string();
  if (fs::is_directory(path, ignored)) {
    throw Error("is a folder, not a file", path, "name a file with " + option);
  }
  if (!parent.empty() && !fs::is_directory(parent, ignored)) {
    throw Error("no such folder: " + parent, path, "make it, or name another file with " + option);
  }
}

// The same of a folder to be filled.
void CheckFolder(const std::string& option, const std::string& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored) || fs::is_directory(path, ignored)) return;
  throw Error("is a file, where a folder is to be made", path, "name a folder with " + option);
}

std::string NameOf(const CLI::Option* option) {
  return option->get_positional() ? option->get_name(true) : "--" + option->get_lnames().front();
}

}  // namespace

CLI::Option* VerbFiles::Read(const std::string& flags, std::string* path, const std::string& help) {
  CLI::Option* option = app_->add_option(flags, *path, help)->type_name(kInput);
  inputs_.push_back({NameOf(option), path});
  return option;
}

CLI::Option* VerbFiles::Write(const std::string& flags, std::string* path,
                              const std::string& help) {
  CLI::Option* option = app_->add_option(flags, *path, help)->type_name(kOutput);
  outputs_.push_back({NameOf(option), path});
  return option;
}

CLI::Option* VerbFiles::WriteForm(const std::string& flags, std::string* path,
                                  const std::string& ending, const std::string& help) {
  CLI::Option* option = Write(flags, path, help);
  forms_.push_back({NameOf(option), path, ending});
  return option;
}

CLI::Option* VerbFiles::WriteOr(const std::string& flags, std::string* path,
                                std::function<std::string()> name, const std::string& help) {
  AddForce();
  CLI::Option* option = Write(flags, path, help);
  defaults_.push_back({NameOf(option), path, std::move(name)});
  return option;
}

CLI::Option* VerbFiles::WriteFolder(const std::string& flags, std::string* path, Names names,
                                    const std::string& help) {
  AddForce();
  CLI::Option* option = FillFolder(flags, path, std::move(names), help);
  outputs_.back().replaces_others = false;
  return option;
}

CLI::Option* VerbFiles::FillFolder(const std::string& flags, std::string* path, Names names,
                                   const std::string& help) {
  CLI::Option* option = app_->add_option(flags, *path, help)->type_name(kFolder);
  outputs_.push_back({NameOf(option), path, std::move(names)});
  return option;
}

void VerbFiles::Page(std::string* path, const std::string& help) {
  page_ = path;
  Write("--report", path, help);
  Write("--pdf", &pdf_, "Also the page of --report as PDF, printed by Chromium");
}

std::string VerbFiles::Print() const {
  // A verb that came to no page leaves an older one as it was.
  if (pdf_.empty() || VersionOf(*page_) == page_before_) return {};
  PrintPage(FindPrinter(), *page_, pdf_);
  return pdf_;
}

void VerbFiles::AddForce() {
  if (app_->get_option_no_throw("--force") != nullptr) return;
  app_->add_flag("--force", force_,
                 "Let outputs that are not named here replace files that this verb did not make");
}

CLI::Option* VerbFiles::Overrides(std::vector<std::string>* sets, const std::string& help) {
  overrides_.push_back(sets);
  return app_->add_option("--set", *sets, help)
      ->type_name(kOverride)
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
}

void VerbFiles::CheckDeclared() const {
  for (const CLI::Option* option : app_->get_options()) {
    if (option->get_type_name().find("TEXT") == std::string::npos) continue;
    throw std::logic_error(fmt::format(
        "unfurl {} takes text as {}, and does not say whether it is a file (cli/verb_files.h)",
        app_->get_name(), option->get_name()));
  }
}

void VerbFiles::CheckMadeHere(const std::string& path, const std::string& remedy) const {
  std::error_code ignored;
  if (force_ || !fs::exists(fs::symlink_status(path, ignored)) || fs::is_directory(path, ignored) ||
      MadeBy(path, app_->get_name())) {
    return;
  }
  throw Error(fmt::format("is there, and `unfurl {}` did not make it", app_->get_name()), path,
              remedy + ", or replace it with --force");
}

std::vector<std::string> VerbFiles::Path::Files() const {
  if (!names) return {*path};
  std::vector<std::string> files;
  for (const std::string& name : names()) files.push_back(*path + "/" + name);
  return files;
}

// A variable of a shell that is not set gives an empty name, which would count as not given.
void VerbFiles::CheckGiven() const {
  for (const CLI::Option* option : app_->get_options()) {
    for (const std::string& value : option->results()) {
      if (!value.empty() || option->get_expected_max() == 0) continue;
      throw Error("is given, and empty", NameOf(option), "give a value, or leave it out");
    }
  }
}

void VerbFiles::CheckApart(const std::map<std::string, std::string>& inputs) const {
  std::map<std::string, std::string> outputs;
  const auto check = [&](const std::string& written, const std::string& option) {
    const std::string identity = IdentityOf(written);
    const auto input = inputs.find(identity);
    if (input != inputs.end()) {
      throw Error(fmt::format("{} would replace it, and it is {}", option, input->second), written,
                  "name another output");
    }
    const auto [other, fresh] = outputs.try_emplace(identity, option);
    if (!fresh) {
      throw Error(fmt::format("{} and {} would both write it", other->second, option), written,
                  "name two different files");
    }
  };
  for (const Path& output : outputs_) {
    if (output.path->empty()) continue;
    for (const std::string& file : output.Files()) {
      for (const std::string& written : WrittenFor(file)) check(written, output.option);
    }
  }
}

void VerbFiles::CheckForms() const {
  for (const Path& output : outputs_) {
    if (output.path->empty()) continue;
    if (output.names) {
      CheckFolder(output.option, *output.path);
    } else {
      CheckPlace(output.option, *output.path);
    }
  }
  for (const Form& form : forms_) {
    if (form.path->empty()) continue;
    CheckEnding(form.option, *form.path, {form.ending}, "end it in " + form.ending);
  }
  for (const Default& output : defaults_) {
    if (data::EndingOf(output.name()) != ".h5") continue;
    CheckEnding(output.option, *output.path, {".h5", ".hdf5"},
                "end it in .h5; `unfurl convert` makes other forms of it");
  }
  if (page_ != nullptr && data::EndingOf(*page_) == ".pdf") {
    throw Error("--report writes HTML, and the name says .pdf", *page_,
                "give --report PAGE.html --pdf PAGE.pdf");
  }
}

void VerbFiles::PreparePrinting() const {
  if (pdf_.empty()) return;
  if (page_->empty()) {
    throw Error("it prints the page of --report, which was not asked for", "--pdf",
                "give --report PAGE.html, too");
  }
  page_before_ = VersionOf(*page_);
  FindPrinter();  // before the work, not after
}

// `simulate run.h5`: what would be written by default is what was given to be read.
void VerbFiles::RefuseOutputAsInput(const std::string& output) const {
  if (data::EndingOf(output) != ".h5") return;
  std::error_code ignored;
  for (const Path& input : inputs_) {
    if (*input.path != output || !fs::is_regular_file(output, ignored)) continue;
    std::array<char, 4> head{};
    std::ifstream(output, std::ios::binary).read(head.data(), head.size());
    if (std::string_view(head.data(), head.size()) != "\x89HDF") continue;
    data::LoadToml(output);  // says what it is, where a text is read
  }
}

void VerbFiles::Prepare() const {
  CheckGiven();
  std::vector<std::string> by_default;
  for (const Default& output : defaults_) {
    if (!output.path->empty()) continue;
    *output.path = output.name();
    RefuseOutputAsInput(*output.path);
    if (!output.path->empty()) by_default.push_back(*output.path);
  }
  CheckApart(Inputs());
  for (const std::string& path : by_default) CheckMadeHere(path, "name another output with -o");
  for (const Path& output : outputs_) {
    if (output.replaces_others || output.path->empty()) continue;
    for (const std::string& file : output.Files()) CheckMadeHere(file, "name another folder");
  }
  CheckForms();
  PreparePrinting();
  data::ProtectWhatIsRead();  // what nobody could name before it was read: from pipes, of programs
}

std::map<std::string, std::string> VerbFiles::Inputs() const {
  std::map<std::string, std::string> inputs;
  const auto add = [&](const std::string& path, const std::string& as) {
    std::error_code ignored;
    if (path.empty() || !fs::exists(path, ignored)) return;
    inputs.try_emplace(IdentityOf(path), as);
    data::ProtectInput(path);
  };
  std::vector<std::string> folders = {"."};
  for (const Path& input : inputs_) {
    add(*input.path, "the input " + input.option);
    if (input.path->empty()) continue;
    folders.push_back(fs::path(*input.path).parent_path().string());
    for (const data::NamedFile& named : data::FilesNamedIn(*input.path)) {
      add(named.path, fmt::format("an input, named in {}", named.where));
    }
  }
  for (const std::vector<std::string>* sets : overrides_) {
    for (const std::string& set : *sets) {
      for (const data::NamedFile& named : data::FilesNamedBy(set, folders)) {
        add(named.path, "an input, named by --set");
      }
    }
  }
  return inputs;
}

}  // namespace unfurl::cli
