#include "complexity.h"

#include <algorithm>
#include <array>
#include <cctype>

namespace unfurl::structure {
namespace {

struct Token {
  std::string text;
  int line;
};

bool IsWord(char c) { return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_'; }

// Words, "::", "->", "&&", "||" and single characters; literals become the word "0"; comments and
// preprocessor lines are left out.
class Lexer {
 public:
  explicit Lexer(std::string_view text) : text_(text) {}

  std::vector<Token> Run() {
    while (at_ < text_.size()) Step();
    return std::move(tokens_);
  }

 private:
  bool Starts(std::string_view what) const { return text_.substr(at_).starts_with(what); }

  void Skip(std::size_t end) {
    end = std::min(end, text_.size());
    line_ += static_cast<int>(std::ranges::count(text_.substr(at_, end - at_), '\n'));
    at_ = end;
  }

  void Push(std::size_t length) {
    tokens_.push_back({std::string(text_.substr(at_, length)), line_});
    Skip(at_ + length);
  }

  void Literal(char quote) {
    tokens_.push_back({"0", line_});
    std::size_t end = at_ + 1;
    while (end < text_.size() && text_[end] != quote) end += text_[end] == '\\' ? 2 : 1;
    Skip(end + 1);
  }

  // R"tag(...)tag"
  void RawLiteral() {
    tokens_.push_back({"0", line_});
    const std::size_t open = text_.find('(', at_);
    const std::string close = ")" + std::string(text_.substr(at_ + 2, open - at_ - 2)) + "\"";
    const std::size_t end = text_.find(close, open);
    Skip(end == std::string_view::npos ? end : end + close.size());
  }

  void PreprocessorLine() {
    std::size_t end = text_.find('\n', at_);
    while (end != std::string_view::npos && text_[end - 1] == '\\') end = text_.find('\n', end + 1);
    Skip(end);
  }

  void Word() {
    std::size_t end = at_;
    const bool number = std::isdigit(static_cast<unsigned char>(text_[at_])) != 0;
    while (end < text_.size() && (IsWord(text_[end]) || (number && text_[end] == '\''))) ++end;
    Push(end - at_);
  }

  void Step() {
    const char c = text_[at_];
    if (Starts("//")) return Skip(text_.find('\n', at_));
    if (Starts("/*")) return Skip(text_.find("*/", at_ + 2) + 2);
    if (Starts("R\"")) return RawLiteral();
    if (c == '"' || c == '\'') return Literal(c);
    if (c == '#') return PreprocessorLine();
    if (IsWord(c)) return Word();
    if (std::isspace(static_cast<unsigned char>(c)) != 0) return Skip(at_ + 1);
    for (const std::string_view two : {"::", "->", "&&", "||"}) {
      if (Starts(two)) return Push(2);
    }
    Push(1);
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
  std::vector<Token> tokens_;
};

bool IsOneOf(const std::string& word, std::initializer_list<std::string_view> words) {
  return std::ranges::find(words, word) != words.end();
}

bool IsDecision(const std::string& word) {
  return IsOneOf(word, {"if", "for", "while", "case", "catch", "?", "&&", "||"});
}

// Walks namespaces and classes and measures each function body that it meets.
class Walker {
 public:
  explicit Walker(std::vector<Token> tokens) : tokens_(std::move(tokens)) {}

  std::vector<FunctionComplexity> Run() {
    while (at_ < tokens_.size()) Step();
    return std::move(found_);
  }

 private:
  const std::string& Text(std::size_t i) const { return tokens_[i].text; }

  // One past the bracket that closes the one at `i`.
  std::size_t Past(std::size_t i, const char* open, const char* close) const {
    int depth = 0;
    for (; i < tokens_.size(); ++i) {
      if (Text(i) == open) ++depth;
      if (Text(i) == close && --depth == 0) return i + 1;
    }
    return tokens_.size();
  }

  // `at_` is at a token of a declaration whose first one is `begin_`.
  void Step() {
    const std::string& word = Text(at_);
    if (word == "(") {
      at_ = Past(at_, "(", ")");
    } else if (word == ";" || word == "}" || IsAccess()) {
      begin_ = ++at_;
    } else if (word == "{") {
      Open();
    } else {
      ++at_;
    }
  }

  bool IsAccess() const {
    return Text(at_) == ":" && at_ == begin_ + 1 &&
           IsOneOf(Text(begin_), {"public", "private", "protected"});
  }

  void Open() {
    std::size_t first = begin_;
    while (first < at_ && Text(first) == "template") first = PastTemplate(first + 1);
    std::size_t parameters = at_, colon = at_;
    bool assigned = false, lambda = false;
    for (std::size_t i = first; i < at_; ++i) {
      if (Text(i) == "operator" && i + 1 < at_) {  // operator(), operator=, operator bool
        i += Text(i + 1) == "(" ? 2 : 1;
        continue;
      }
      if (Text(i) == "=" && parameters == at_) {
        assigned = true;
        lambda = i + 1 < at_ && Text(i + 1) == "[";
      }
      if (Text(i) == ":" && parameters < at_) colon = std::min(colon, i);
      if (Text(i) != "(") continue;
      parameters = std::min(parameters, i);
      i = Past(i, "(", ")") - 1;
    }
    const bool scope = IsOneOf(Text(first), {"namespace", "class", "struct", "union", "extern"});
    if (scope && !assigned && (parameters == at_ || Text(first) != "extern")) {
      begin_ = ++at_;  // its members follow
    } else if (parameters == at_ || (assigned && !lambda) || Text(first) == "enum") {
      at_ = Past(at_, "{", "}");  // an initialiser or a list of enumerators
    } else if (colon < at_ && Text(at_ - 1) != ")" && Text(at_ - 1) != "}") {
      at_ = Past(at_, "{", "}");  // of a member, in a constructor's list
    } else {
      Measure(parameters);
    }
  }

  std::size_t PastTemplate(std::size_t i) const { return Past(i, "<", ">"); }

  void Measure(std::size_t parameters) {
    FunctionComplexity function{Name(parameters), tokens_[at_].line, 1};
    const std::size_t end = Past(at_, "{", "}");
    for (; at_ < end; ++at_) {
      const bool reference = Text(at_) == "&&" && Text(at_ - 1) == "auto";
      function.complexity += IsDecision(Text(at_)) && !reference ? 1 : 0;
    }
    found_.push_back(std::move(function));
    begin_ = at_;
  }

  // The words before the parameters that belong together: A::B::Name.
  std::string Name(std::size_t parameters) const {
    std::string name;
    for (std::size_t i = parameters; i-- > begin_;) {
      const bool word = IsWord(Text(i).back());
      if (!word && !IsOneOf(Text(i), {"::", "~", "=", "[", "]"})) break;
      if (word && !name.empty() && IsWord(name.front())) break;
      name = Text(i) + name;
    }
    return name;
  }

  std::vector<Token> tokens_;
  std::size_t at_ = 0, begin_ = 0;
  std::vector<FunctionComplexity> found_;
};

}  // namespace

std::vector<FunctionComplexity> ComplexityOf(std::string_view text) {
  return Walker(Lexer(text).Run()).Run();
}

}  // namespace unfurl::structure
