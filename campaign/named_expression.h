#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

namespace unfurl::campaign {

/// An expression of named numbers, such as "limit - peak" or "a > 2 && b < 1" (1 and 0). By
/// muParser: + - * / ^, comparisons, && ||, ?:, and its functions. Not for several threads at once.
class NamedExpression {
 public:
  /// `names`: what may stand in it. Throws Error at `where` for what is no expression, or has other
  /// names.
  NamedExpression(const std::string& text, const std::vector<std::string>& names,
                  const std::string& where);
  ~NamedExpression();
  NamedExpression(NamedExpression&&) noexcept;
  NamedExpression& operator=(NamedExpression&&) noexcept;

  /// `values` in the order of the names; NaN where the result is none.
  double Value(std::span<const double> values) const;
  /// Indices of the names that occur in it.
  const std::vector<std::size_t>& used() const { return used_; }

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
  std::vector<std::size_t> used_;
};

}  // namespace unfurl::campaign
