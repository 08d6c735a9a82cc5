#pragma once

#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace unfurl::data {

// A TOML file that a person wrote, read strictly: each key read is remembered, and what is left
// unread is an error that names the nearest key the reader would have taken. Errors carry
// file:line:key. toml++ stays behind data/toml_node.h.

class TomlTable;

// Bounds of a number; the unit is the key's.
struct TomlRange {
  double low = -std::numeric_limits<double>::infinity();  // [the key's unit]
  double high = std::numeric_limits<double>::infinity();  // [the key's unit]
  bool open_low = false;                                  // low itself is refused
  bool open_high = false;                                 // high itself is refused
};
inline constexpr TomlRange kAny{};
inline constexpr TomlRange kPositive{0.0, std::numeric_limits<double>::infinity(), true, false};
inline constexpr TomlRange kNonNegative{0.0};

// `overrides` are "dotted.key=value" with a TOML value (a bare word is taken as a string), applied
// before anything is read; a value for a table that is not there makes it. Errors in them are
// placed at "--set dotted.key". "key[2]" is the third item of an array, which must be there.
//
// `include = ["common.toml"]` at the top of a file merges those files under it, table by table: the
// file's own keys win, then those of a later file in the list. Names are relative to the file that
// includes; a file that includes itself, directly or not, is refused. Errors name the file that a
// key stands in.
TomlTable LoadToml(const std::string& path, const std::vector<std::string>& overrides = {});
class TextFiles;
TomlTable LoadToml(const std::string& path, const std::vector<std::string>& overrides,
                   TextFiles* files);
TomlTable ParseToml(const std::string& text, const std::string& name);

// One table of a file, with the place of each key for messages.
class TomlTable {
 public:
  TomlTable() = default;

  bool Has(std::string_view key) const;  // false for an absent key

  // Required values; NaN and infinity are refused always.
  double Number(std::string_view key, TomlRange range = kAny) const;
  int Integer(std::string_view key, int low, int high) const;
  bool Bool(std::string_view key) const;
  std::string String(std::string_view key) const;
  std::string Choice(std::string_view key, const std::vector<std::string>& allowed) const;
  // `size` < 0: any length.
  std::vector<double> Numbers(std::string_view key, int size, TomlRange range = kAny) const;
  std::vector<std::string> Strings(std::string_view key) const;
  // Rows of equal length `columns`.
  std::vector<std::vector<double>> Rows(std::string_view key, int columns) const;

  // The same, with a default for an absent key.
  double NumberOr(std::string_view key, double fallback, TomlRange range = kAny) const;
  int IntegerOr(std::string_view key, int fallback, int low, int high) const;
  bool BoolOr(std::string_view key, bool fallback) const;
  std::string StringOr(std::string_view key, const std::string& fallback) const;
  std::string ChoiceOr(std::string_view key, const std::string& fallback,
                       const std::vector<std::string>& allowed) const;
  std::vector<double> NumbersOr(std::string_view key, std::vector<double> fallback, int size,
                                TomlRange range = kAny) const;
  std::vector<std::string> StringsOr(std::string_view key, std::vector<std::string> fallback) const;

  // [key]; the required one throws when absent.
  TomlTable Table(std::string_view key) const;
  std::optional<TomlTable> TableOrNone(std::string_view key) const;
  // [key.NAME] ..., in file order.
  std::vector<std::pair<std::string, TomlTable>> NamedTables(std::string_view key) const;
  // [[key]] ..., in file order; empty when absent.
  std::vector<TomlTable> TableArray(std::string_view key) const;

  // The items of the array `key` as a table with keys "0", "1", ..: for arrays whose items take
  // several forms.
  TomlTable Items(std::string_view key, int size) const;

  // True when `key` holds a number, a string, an array, a table: for keys that take several forms.
  bool IsNumber(std::string_view key) const;
  bool IsString(std::string_view key) const;
  bool IsArray(std::string_view key) const;
  bool IsTable(std::string_view key) const;

  // Every key of the document from here on, dotted, with its value as text: for `unfurl info`.
  std::vector<std::pair<std::string, std::string>> Outline() const;

  // Every key asked for so far, here and in any table below, dotted.
  std::vector<std::string> Asked() const;

  // The files that the document came from, the first one first.
  std::vector<std::string> Files() const;

  // Throws on the first key, here or in any table below, that was never asked for.
  void RefuseUnknownKeys() const;

  // "scene.toml:12:beam.beam1.mass", for an Error about that key; empty key: the table itself.
  std::string Where(std::string_view key = {}) const;
  // "beam.beam1": the dotted path of this table.
  const std::string& path() const;
  [[noreturn]] void Fail(std::string_view key, const std::string& what,
                         const std::string& remedy) const;
  // For a key that is wanted and not there. Where the whole table is there by an override alone,
  // its name is the likelier mistake.
  [[noreturn]] void FailMissing(std::string_view key) const;

 private:
  friend class TomlDocument;
  friend TomlTable LoadToml(const std::string&, const std::vector<std::string>&, TextFiles*);
  friend TomlTable ParseToml(const std::string&, const std::string&);
  struct Node;
  explicit TomlTable(std::shared_ptr<Node> node) : node_(std::move(node)) {}
  std::shared_ptr<Node> node_;
};

/// Texts of files, each read from disk once, the first time that it is asked for. Whoever reads a
/// document several times through one of these reads the same document each time, whatever happens
/// to the files meanwhile. Not for several threads.
class TextFiles {
 public:
  /// Throws Error for a file that cannot be read.
  const std::string& Read(const std::string& path);

 private:
  std::map<std::string, std::string> texts_;
};

/// A document that was read and parsed once, and of which copies with other numbers are made.
/// Copies may be made by several threads.
class TomlDocument {
 public:
  /// A number to be set: "beam.arm.damping", "gravity.acceleration[1]".
  struct Value {
    std::string key;
    double number = 0.0;  // [what the key is in]
  };

  TomlDocument() = default;
  /// As LoadToml; `files` null: from disk.
  explicit TomlDocument(const std::string& path, const std::vector<std::string>& overrides = {},
                        TextFiles* files = nullptr);

  /// The document as it was read: errors carry file:line:key.
  const TomlTable& table() const;
  /// A copy with these numbers set, those without a fraction as whole numbers. Errors carry file
  /// and key, "--set KEY" for a number that was set here. Throws Error for a key that cannot be
  /// set.
  TomlTable With(const std::vector<Value>& values) const;

 private:
  std::shared_ptr<const TomlTable> table_;
};

}  // namespace unfurl::data
