// Complexities counted by hand.
#include "complexity.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

namespace unfurl::structure::complexity_test {
namespace {

using testing::ElementsAre;
using testing::FieldsAre;
using testing::IsEmpty;

TEST(ComplexityOf, CountsDecisions) {
  EXPECT_THAT(ComplexityOf("int F() { return 0; }"), ElementsAre(FieldsAre("F", 1, 1)));
  EXPECT_THAT(ComplexityOf("int F(int a)\n{\n  if (a && !b || c) return a ? 1 : 2;\n}"),
              ElementsAre(FieldsAre("F", 2, 5)));
  EXPECT_THAT(ComplexityOf("void F() { for (;;) while (x) { do { } while (y); } }"),
              ElementsAre(FieldsAre("F", 1, 4)));
  EXPECT_THAT(ComplexityOf("void F() { switch (k) { case 1: case 2: break; default: break; } }"),
              ElementsAre(FieldsAre("F", 1, 3)));
  EXPECT_THAT(ComplexityOf("void F() { try { G(); } catch (...) { } for (auto&& x : y) H(); }"),
              ElementsAre(FieldsAre("F", 1, 3)));
  EXPECT_THAT(ComplexityOf("void F() { const auto g = [&](int i) { return i ? 1 : 2; }; }"),
              ElementsAre(FieldsAre("F", 1, 2)));
}

TEST(ComplexityOf, PassesOverLiteralsCommentsAndDirectives) {
  EXPECT_THAT(ComplexityOf("#if A && B\nvoid F() {\n  // if\n  /* if\n  if */ G(\"if (\\\" ?\", "
                           "'?', R\"x(if \" ?)\" if)x\", 1'000);\n}\n"),
              ElementsAre(FieldsAre("F", 2, 1)));
}

TEST(ComplexityOf, SeesWhatIsAFunction) {
  // Declarations, initialisers and enumerations are none.
  EXPECT_THAT(ComplexityOf("int F(int a = {}); enum class E : int { kA, kB };\n"
                           "constexpr int kX[] = {1, 2}; struct S { int a{3}; int b = 4; };\n"
                           "const std::map<int, int> m = {{F(1), 2}};"),
              IsEmpty());
  const std::string scopes =
      "namespace a::b { namespace {\n"
      "struct D final : public x::B, C { D() : B(1), m_{2}, n_(G(3)) { if (m_) G(); }\n"
      "  ~D() override = default;\n"
      " private:\n"
      "  bool operator()(int i) const { return i && m_; }\n"
      "  D& operator=(const D&) { return *this; }\n"
      "  int m_{1}; };\n"
      "} }\n"
      "template <typename T, class U>\n"
      "auto a::D::Last(T t) -> std::vector<T> { return t ? U{} : T{}; }\n"
      "const auto kLambda = [](int a) { return a || F(); };\n";
  EXPECT_THAT(
      ComplexityOf(scopes),
      ElementsAre(FieldsAre("D", 2, 2), FieldsAre(testing::_, 5, 2), FieldsAre(testing::_, 6, 1),
                  FieldsAre("a::D::Last", 10, 2), FieldsAre(testing::_, 11, 2)));
}

}  // namespace
}  // namespace unfurl::structure::complexity_test
