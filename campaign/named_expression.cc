#include "campaign/named_expression.h"

#include <muParser.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/text.h"

namespace unfurl::campaign {

namespace {

// muParser's own: it would change a variable for what comes after.
bool Assigns(const std::string& text) {
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '=') continue;
    if (i + 1 < text.size() && text[i + 1] == '=') {
      ++i;
      continue;
    }
    if (i == 0 || std::string("<>!").find(text[i - 1]) == std::string::npos) return true;
  }
  return false;
}

}  // namespace

struct NamedExpression::Impl {
  mu::Parser parser;
  std::vector<double> values;  // that the parser's variables stand for
};

NamedExpression::NamedExpression(const std::string& text, const std::vector<std::string>& names,
                                 const std::string& where)
    : impl_(std::make_unique<Impl>()) {
  impl_->values.assign(names.size(), 1.0);
  if (Assigns(text)) throw Error("assigns a value", where, "compare with ==");
  try {
    for (std::size_t i = 0; i < names.size(); ++i) {
      impl_->parser.DefineVar(names[i], &impl_->values[i]);
    }
    impl_->parser.SetExpr(text);
    for (const auto& [name, place] : impl_->parser.GetUsedVar()) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end()) {
        const std::string near = NearestName(name, names);
        throw Error(
            "'" + name + "' stands for nothing here", where,
            near.empty() ? "known are " + JoinWords(names) : "did you mean '" + near + "'?");
      }
      used_.push_back(static_cast<std::size_t>(found - names.begin()));
    }
    int results = 0;
    impl_->parser.Eval(results);
    if (results != 1) {
      throw Error("gives several numbers", where, "write one expression, without commas");
    }
  } catch (const mu::Parser::exception_type& e) {
    throw Error("is no expression: " + e.GetMsg(), where,
                "write numbers, names, + - * / ^, comparisons, and functions such as sqrt()");
  }
  std::sort(used_.begin(), used_.end());
}

NamedExpression::~NamedExpression() = default;
NamedExpression::NamedExpression(NamedExpression&&) noexcept = default;
NamedExpression& NamedExpression::operator=(NamedExpression&&) noexcept = default;

double NamedExpression::Value(std::span<const double> values) const {
  std::copy(values.begin(), values.end(), impl_->values.begin());
  try {
    const double value = impl_->parser.Eval();
    return std::isfinite(value) ? value : std::numeric_limits<double>::quiet_NaN();
  } catch (const mu::Parser::exception_type&) {  // a logarithm of nothing, say
    return std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace unfurl::campaign
