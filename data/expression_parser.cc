#include "data/expression_parser.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::data {
namespace {

using ExpressionParserOp = Expression::Op;
using Program = std::vector<Expression::Instruction>;

struct Function {
  const char* name;
  ExpressionParserOp op;
  int arguments;
};

constexpr Function kExpressionParserFunctions[] = {
    {"sin", ExpressionParserOp::kSin, 1},   {"cos", ExpressionParserOp::kCos, 1},
    {"tan", ExpressionParserOp::kTan, 1},   {"asin", ExpressionParserOp::kAsin, 1},
    {"acos", ExpressionParserOp::kAcos, 1}, {"atan", ExpressionParserOp::kAtan, 1},
    {"sinh", ExpressionParserOp::kSinh, 1}, {"cosh", ExpressionParserOp::kCosh, 1},
    {"tanh", ExpressionParserOp::kTanh, 1}, {"exp", ExpressionParserOp::kExp, 1},
    {"log", ExpressionParserOp::kLog, 1},   {"sqrt", ExpressionParserOp::kSqrt, 1},
    {"abs", ExpressionParserOp::kAbs, 1},   {"step", ExpressionParserOp::kStep, 1},
    {"ramp", ExpressionParserOp::kRamp, 1}, {"smoothstep", ExpressionParserOp::kSmoothStep, 1},
    {"min", ExpressionParserOp::kMin, 2},   {"max", ExpressionParserOp::kMax, 2}};

bool IsLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_'; }
bool IsDigit(char c) { return c >= '0' && c <= '9'; }

// Recursive descent:
//   sum     = product { (+|-) product }
//   product = signed { (*|/) signed }
//   signed  = (+|-) signed | power
//   power   = atom [ ^ signed ]            so -2^2 = -4 and 2^3^2 = 2^9
//   atom    = number | name | name ( sum {, sum} ) | ( sum )
class Parser {
 public:
  Parser(const std::string& text, const std::string& where) : text_(text), where_(where) {}

  Program Parse() {
    if (text_.size() > kExpressionLongest) {
      throw Error(fmt::format("an expression of {} characters", text_.size()), where_,
                  fmt::format("keep it to {}, or give a table", kExpressionLongest));
    }
    Skip();
    if (at_ == text_.size()) throw Error("the expression is empty", where_, "give one of t");
    Sum();
    if (at_ < text_.size()) {
      if (text_[at_] == ')') Fail(at_, "a ')' closes nothing", "remove it");
      Fail(at_, fmt::format("'{}' where an operator is needed", Word()),
           "write + - * / ^ between the parts");
    }
    return std::move(program_);
  }

 private:
  [[noreturn]] void Fail(std::size_t at, const std::string& what, const std::string& remedy) const {
    constexpr std::size_t kShown = 80;  // characters of it: the message stays a line or two
    const std::string shown = text_.size() > kShown ? text_.substr(0, kShown) + "..." : text_;
    throw Error(fmt::format("column {} of \"{}\": {}", at + 1, shown, what), where_, remedy);
  }
  void Skip() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\t' || text_[at_] == '\n')) {
      ++at_;
    }
  }
  bool Take(char c) {
    if (at_ == text_.size() || text_[at_] != c) return false;
    ++at_;
    Skip();
    return true;
  }
  std::string Word() const {
    std::size_t end = at_;
    while (end < text_.size() && (IsLetter(text_[end]) || IsDigit(text_[end]))) ++end;
    return text_.substr(at_, std::max<std::size_t>(end - at_, 1));
  }

  void Push(ExpressionParserOp op, double number = 0.0) {
    program_.push_back({op, number});
    if (++depth_ > kExpressionDepth) {
      Fail(at_, "too many parts wait for each other", "write fewer nested parentheses");
    }
  }
  // Operators on numbers alone are worked out here.
  void Emit(ExpressionParserOp op, int operands) {
    depth_ -= operands - 1;
    bool constant = true;
    for (int k = 0; k < operands; ++k)
      constant &= program_.rbegin()[k].op == ExpressionParserOp::kNumber;
    program_.push_back({op});
    if (!constant) return;
    const double value =
        Expression(Program(program_.end() - operands - 1, program_.end())).Value(0);
    if (!std::isfinite(value)) return;  // left for FindFault, which gives the reason
    program_.resize(program_.size() - operands - 1);
    program_.push_back({ExpressionParserOp::kNumber, value});
  }

  void Sum() {
    if (++nesting_ > kMostNesting) Fail(at_, "nested too deeply", "write fewer parentheses");
    Product();
    for (;;) {
      if (Take('+')) {
        Product();
        Emit(ExpressionParserOp::kAdd, 2);
      } else if (Take('-')) {
        Product();
        Emit(ExpressionParserOp::kSubtract, 2);
      } else {
        break;
      }
    }
    --nesting_;
  }

  void Product() {
    Signed();
    for (;;) {
      if (Take('*')) {
        if (at_ < text_.size() && text_[at_] == '*') Fail(at_, "there is no '**'", "write ^");
        Signed();
        Emit(ExpressionParserOp::kMultiply, 2);
      } else if (Take('/')) {
        Signed();
        Emit(ExpressionParserOp::kDivide, 2);
      } else {
        return;
      }
    }
  }

  void Signed() {
    bool negative = false;
    for (;;) {
      if (Take('-')) {
        negative = !negative;
      } else if (!Take('+')) {
        break;
      }
    }
    Power();
    if (negative) Emit(ExpressionParserOp::kNegate, 1);
  }

  void Power() {
    Atom();
    if (!Take('^')) return;
    if (++nesting_ > kMostNesting) Fail(at_, "nested too deeply", "write parentheses");
    Signed();
    --nesting_;
    Emit(ExpressionParserOp::kPower, 2);
  }

  void Atom() {
    const std::size_t begin = at_;
    if (at_ == text_.size()) Fail(at_, "the expression ends too early", "complete it");
    if (Take('(')) {
      Sum();
      if (!Take(')'))
        Fail(at_, fmt::format("the '(' of column {} is not closed", begin + 1), "add a ')'");
      return;
    }
    const char c = text_[at_];
    if (IsDigit(c) || c == '.') return Number();
    if (!IsLetter(c)) {
      Fail(at_, fmt::format("'{}' where a number, t or a function is needed", c), "correct it");
    }
    const std::string name = Word();
    at_ += name.size();
    Skip();
    if (name == "t") return Push(ExpressionParserOp::kTime);
    if (name == "pi") return Push(ExpressionParserOp::kNumber, std::numbers::pi);
    if (name == "e") return Push(ExpressionParserOp::kNumber, std::numbers::e);
    for (const Function& f : kExpressionParserFunctions) {
      if (name == f.name) return Call(f, begin);
    }
    std::vector<std::string> known{"t", "pi", "e"};
    for (const Function& f : kExpressionParserFunctions) known.push_back(f.name);
    const std::string nearest = NearestName(name, known);
    Fail(begin, fmt::format("'{}' is not known", name),
         nearest.empty() ? "use " + JoinWords(known) : "did you mean '" + nearest + "'?");
  }

  void Call(const Function& f, std::size_t begin) {
    const char* form = f.arguments == 2 ? "(a, b)" : "(x)";
    const std::string remedy = fmt::format("write {}{}", f.name, form);
    if (!Take('('))
      Fail(begin, fmt::format("'{}' needs its argument in parentheses", f.name), remedy);
    for (int k = 0; k < f.arguments; ++k) {
      if (k > 0 && !Take(','))
        Fail(at_, fmt::format("'{}' takes {} arguments", f.name, f.arguments), remedy);
      Sum();
    }
    if (at_ < text_.size() && text_[at_] == ',') {
      Fail(
          at_,
          fmt::format("'{}' takes {}", f.name, f.arguments == 1 ? "one argument" : "two arguments"),
          remedy);
    }
    if (!Take(')')) Fail(at_, fmt::format("the '(' of '{}' is not closed", f.name), "add a ')'");
    Emit(f.op, f.arguments);
  }

  void Number() {
    double value = 0.0;
    const auto [end, error] =
        std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
    if (error != std::errc()) Fail(at_, "a number that cannot be read", "correct it");
    at_ = static_cast<std::size_t>(end - text_.data());
    Skip();
    Push(ExpressionParserOp::kNumber, value);
  }

  static constexpr int kMostNesting = 200;  // far from what overflows the stack of the recursion
  const std::string& text_;
  const std::string& where_;
  std::size_t at_ = 0;
  int depth_ = 0, nesting_ = 0;
  Program program_;
};

}  // namespace

Program ParseExpression(const std::string& text, const std::string& where) {
  return Parser(text, where).Parse();
}

}  // namespace unfurl::data
