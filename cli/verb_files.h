#pragma once

#include <functional>
#include <map>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace unfurl::cli {

// What a text that a verb writes into a folder says in its first 512 bytes, so that the same verb
// may replace it.
std::string MadeByWords(const std::string& verb);

// The files that a verb reads and writes, registered as its options are declared, so that no output
// can ever take the place of an input. Every option that takes text is declared here as a file to
// read, a file to write or overrides, or carries a type name of its own (a word, a list of names):
// the program refuses to start with one that is not.
class VerbFiles {
 public:
  // Of the files in a folder; asked for when all verbs are declared.
  using Names = std::function<std::vector<std::string>()>;

  explicit VerbFiles(CLI::App* app) : app_(app) {}
  VerbFiles(const VerbFiles&) = delete;
  VerbFiles& operator=(const VerbFiles&) = delete;

  // The strings and lists live at least as long as the program's options.
  CLI::Option* Read(const std::string& flags, std::string* path, const std::string& help);
  CLI::Option* Write(const std::string& flags, std::string* path, const std::string& help);
  // The same of a file of one form: a name that ends as another form does is refused.
  CLI::Option* WriteForm(const std::string& flags, std::string* path, const std::string& ending,
                         const std::string& help);
  // --report, a page, and --pdf, the same page printed.
  void Page(std::string* path, const std::string& help);
  // Where the option is not given, `name` gives the file; empty: none is written. A file of that
  // name which this verb did not make stays, unless --force is given (the flag is declared here).
  CLI::Option* WriteOr(const std::string& flags, std::string* path,
                       std::function<std::string()> name, const std::string& help);
  // A folder in which files of these `names` are written. As they are not named on the command
  // line, files that this verb did not make stay, unless --force is given.
  CLI::Option* WriteFolder(const std::string& flags, std::string* path, Names names,
                           const std::string& help);
  // The same, of a verb that replaces no file in it, whoever made it.
  CLI::Option* FillFolder(const std::string& flags, std::string* path, Names names,
                          const std::string& help);
  // "KEY=VALUE" for a TOML input; values may name files, too.
  CLI::Option* Overrides(std::vector<std::string>* sets, const std::string& help);

  // Throws std::logic_error for an option that takes text and is not declared.
  void CheckDeclared() const;

  // Before any work: fills in default names, and throws Error where an output is one of the inputs
  // (by device and inode, through links, includes and files that a TOML input names), where two
  // outputs are one file, or where a name that was not given is taken.
  void Prepare() const;

  // After the verb: prints its page where --pdf asks for it and gives the name; else empty.
  std::string Print() const;

 private:
  struct Path {
    std::string option;  // as the person knows it: "SCENE", "--report"
    const std::string* path;
    Names names{};                // of the files in it; none: it is a file
    bool replaces_others = true;  // may replace files that this verb did not make
    std::vector<std::string> Files() const;
  };
  struct Default {
    std::string option;
    std::string* path;
    std::function<std::string()> name;
  };
  void AddForce();
  void CheckMadeHere(const std::string& path, const std::string& remedy) const;
  // Of what Prepare throws Error for: options without a value; outputs that are an input or one
  // another; places and endings that do not go with what is written; a page to print that is none.
  void CheckGiven() const;
  void RefuseOutputAsInput(const std::string& output) const;
  void CheckApart(const std::map<std::string, std::string>& inputs) const;
  void CheckForms() const;
  void PreparePrinting() const;
  // Inputs by identity, with how they came to be inputs.
  std::map<std::string, std::string> Inputs() const;

  CLI::App* app_;
  std::vector<Path> inputs_, outputs_;
  struct Form {
    std::string option;
    const std::string* path;
    std::string ending;  // ".png"
  };
  std::vector<Form> forms_;
  std::vector<Default> defaults_;
  std::vector<const std::vector<std::string>*> overrides_;
  bool force_ = false;
  const std::string* page_ = nullptr;  // of --report
  mutable std::string page_before_;    // what stood there when work began
  std::string pdf_;
};

}  // namespace unfurl::cli
