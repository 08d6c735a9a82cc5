// Tracks as universal files, dataset 58.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "data/atomic_file.h"
#include "data/tracks_exchange.h"
#include "strobed_tracks.h"
#include "tests/data/errors.h"

namespace unfurl::data::tracks_uff_test {
namespace {

TEST(Uff, ThereAndBack) {
  const Tracks tracks = Strobed();
  const Tracks back = ThereAndBack(".uff", tracks, WriteTracksUff, ReadTracksUff);
  ASSERT_EQ(back.size(), tracks.size() - 1);  // what has no position is not in the file
  EXPECT_EQ(back.marks, tracks.marks);
  for (std::size_t i = 0, j = 0; i < tracks.size(); ++i) {
    if (!Usable(tracks.status[i])) continue;
    const auto a = static_cast<Eigen::Index>(i), b = static_cast<Eigen::Index>(j);
    EXPECT_NEAR(back.t[j], tracks.t[i], 1e-9);
    EXPECT_EQ(back.mark[j], tracks.mark[i]);
    EXPECT_EQ(back.status[j], tracks.status[i]);
    EXPECT_LT((back.p.col(b) - tracks.p.col(a)).norm(), 1e-11);
    EXPECT_LT((back.cov.col(b) - tracks.cov.col(a)).norm(), 1e-20);
    ++j;
  }
}

TEST(Uff, ReadsWhatOthersWrite) {
  // Written by hand after the format's description: node 11, even spacing, single precision; a
  // dataset of another kind before it.
  std::string text = "    -1\n   151\nsome header\n    -1\n";
  const char* words[] = {"x", "y", "z"};
  for (int d = 1; d <= 3; ++d) {
    text += "    -1\n    58\n";
    text +=
        std::string("Displacement ") + words[d - 1] + "\nNONE\n01-Jan-26 12:00:00\nNONE\nNONE\n";
    char line[100];
    std::snprintf(line, sizeof line, "%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", 1, 0, 0, 0,
                  "NONE", 11, d, "NONE", 0, 0);
    text += line;
    text += "         2         3         1  0.00000E+00  5.00000E-03  0.00000E+00\n";
    text += "        17    0    0    0 Time                 s                   \n";
    text += "         8    1    0    0 Displacement         m                   \n";
    text += "         0    0    0    0 NONE                 NONE                \n";
    text += "         0    0    0    0 NONE                 NONE                \n";
    for (int i = 0; i < 3; ++i) {
      std::snprintf(line, sizeof line, "%13.5E", d + 0.25 * i);
      text += line;
    }
    text += "\n    -1\n";
  }
  const std::string path = ExchangePath("other.uff");
  WriteTextFile(path, text);
  EXPECT_NE(ErrorOf([&] { ReadTracksUff(path); }).find("without a sigma"), std::string::npos);
  const Tracks tracks = ReadTracksUff(path, 1e-3);
  ASSERT_EQ(tracks.size(), 3U);
  EXPECT_EQ(tracks.marks[0], "node11");
  EXPECT_DOUBLE_EQ(tracks.t[2], 0.01);
  EXPECT_DOUBLE_EQ(tracks.p(1, 1), 2.25);
  EXPECT_DOUBLE_EQ(tracks.cov(0, 0), 1e-6);
  WriteTextFile(path, text.substr(0, text.size() / 2));
  EXPECT_NE(ErrorOf([&] { ReadTracksUff(path, 1e-3); }), "no error");
  std::remove(path.c_str());
}

// One function of a universal file as another program writes it.
struct ForeignUff {
  int function = 1, node = 11, direction = 1, form = 2, abscissa = 17, ordinate = 8,
      denominator = 0;
  bool even = true;
  std::string t_unit = "s", y_unit = "m";
  char exponent = 'E';
  std::string binary;  // "le" or "be": dataset 58b
  std::vector<double> t = {0.0, 0.005, 0.01}, y = {1.0, 1.25, 1.5};

  template <typename T>
  void Pack(T value, std::string* out) const {
    char bytes[sizeof(T)];
    std::memcpy(bytes, &value, sizeof(T));
    if (binary == "be") std::reverse(bytes, bytes + sizeof(T));
    out->append(bytes, sizeof(T));
  }
  std::string Values() const {
    std::string out;
    for (std::size_t i = 0; i < y.size(); ++i) {
      char text[64];
      if (binary.empty()) {
        if (!even) std::snprintf(text, sizeof text, "%13.5E", t[i]), out += text;
        std::snprintf(text, sizeof text, form == 4 ? "%20.12E" : "%13.5E", y[i]), out += text;
        if (i % 3 == 2) out += "\n";
      } else {
        if (!even) Pack(static_cast<float>(t[i]), &out);
        form == 4 ? Pack(y[i], &out) : Pack(static_cast<float>(y[i]), &out);
      }
    }
    if (binary.empty()) {
      std::replace(out.begin(), out.end(), 'E', exponent);
      if (out.back() != '\n') out += '\n';
    }
    return out;
  }
  std::string Text() const {
    const std::string values = Values();
    char head[200] = "    58\n";
    if (!binary.empty()) {
      std::snprintf(head, sizeof head, "    58b%6d%6d%12d%12zu%6d%6d%12d%12d\n",
                    binary == "be" ? 2 : 1, 2, 11, values.size(), 0, 0, 0, 0);
    }
    std::string text = std::string("    -1\n") + head + "Response\nNONE\n01-Jan-26\nNONE\nNONE\n";
    char line[200];
    std::snprintf(line, sizeof line, "%5d%10d%5d%10d %-10s%10d%4d %-10s%10d%4d\n", function, 0, 0,
                  0, "NONE", node, direction, "NONE", 0, 0);
    text += line;
    std::snprintf(line, sizeof line, "%10d%10zu%10d%13.5E%13.5E%13.5E\n", form, y.size(),
                  even ? 1 : 0, 0.0, even ? 0.005 : 0.0, 0.0);
    text += line;
    const auto axis = [&](int type, const std::string& unit) {
      std::snprintf(line, sizeof line, "%10d%5d%5d%5d %-20s %-20s\n", type, 0, 0, 0, "axis",
                    unit.c_str());
      text += line;
    };
    axis(abscissa, t_unit);
    axis(ordinate, y_unit);
    axis(denominator, "NONE");
    axis(0, "NONE");
    text += values;
    return text + (binary.empty() ? "" : "\n") + "    -1\n";
  }
  // Along x, y and z.
  std::string Node() const {
    std::string text;
    for (int d = 1; d <= 3; ++d) {
      ForeignUff one = *this;
      one.direction = one.direction < 0 ? -d : d;
      text += one.Text();
    }
    return text;
  }
};

constexpr char kMillimetres[] =
    "    -1\n   164\n         5MM: mm (milli-newton)             2\n"
    "  1.0000000000000000D+03  1.0000000000000000D+03  1.0000000000000000D+00\n"
    "  2.7314999999999998D+02\n    -1\n";

Tracks ReadUffText(const std::string& text) {
  const std::string path = ExchangePath("foreign.uff");
  WriteTextFile(path, text);
  struct Gone {
    std::string path;
    ~Gone() { std::remove(path.c_str()); }
  } gone{path};
  return ReadTracksUff(path, 1e-3);
}

TEST(Uff, NumberFormatsAndByteOrders) {
  for (const char* binary : {"", "le", "be"}) {
    for (const int form : {2, 4}) {
      for (const bool even : {true, false}) {
        for (const char exponent : {'E', 'D'}) {
          ForeignUff f;
          f.binary = binary;
          f.form = form;
          f.even = even;
          f.exponent = exponent;
          const Tracks tracks = ReadUffText("    -1\n   151\nhead\n    -1\n" + f.Node());
          ASSERT_EQ(tracks.size(), 3U) << binary << form << even << exponent;
          EXPECT_FLOAT_EQ(static_cast<float>(tracks.t[2]), 0.01F);
          EXPECT_DOUBLE_EQ(tracks.p(2, 1), 1.25);
        }
      }
    }
  }
}

TEST(Uff, UnitsAreHonoured) {
  ForeignUff f;
  EXPECT_DOUBLE_EQ(ReadUffText(kMillimetres +
                               [&] {
                                 f.y_unit = "mm";
                                 return f.Node();
                               }())
                       .p(0, 1),
                   1.25e-3);
  f.y_unit = "NONE";
  EXPECT_DOUBLE_EQ(ReadUffText(kMillimetres + f.Node()).p(0, 1), 1.25e-3);
  EXPECT_NE(ErrorOf([&] { ReadUffText(f.Node()); }).find("names no unit"), std::string::npos);
  f.y_unit = "in";
  EXPECT_DOUBLE_EQ(ReadUffText(f.Node()).p(0, 1), 1.25 * 0.0254);
  f.y_unit = "m";
  EXPECT_NE(ErrorOf([&] { ReadUffText(kMillimetres + f.Node()); }).find("dataset 164"),
            std::string::npos);
  f.y_unit = "furlong";
  EXPECT_NE(ErrorOf([&] { ReadUffText(f.Node()); }).find("'furlong'"), std::string::npos);
  f.y_unit = "m";
  f.t_unit = "ms";
  EXPECT_DOUBLE_EQ(ReadUffText(f.Node()).t[1], 5e-6);
  f.t_unit = "min";
  EXPECT_NE(ErrorOf([&] { ReadUffText(f.Node()); }).find("'min'"), std::string::npos);
  f.t_unit = "s";
  f.direction = -1;
  EXPECT_DOUBLE_EQ(ReadUffText(f.Node()).p(2, 1), -1.25);
}

TEST(Uff, OnlyDisplacementsOverTimeAreTaken) {
  const auto refused = [](auto change) {
    ForeignUff f;
    change(f);
    return ErrorOf([&] { ReadUffText(f.Node()); });
  };
  EXPECT_NE(refused([](ForeignUff& f) { f.ordinate = 12; }).find("acceleration over time"),
            std::string::npos);
  EXPECT_NE(refused([](ForeignUff& f) {
              f.abscissa = 18;
              f.function = 4;
            }).find("frequency response (displacement over frequency)"),
            std::string::npos);
  EXPECT_NE(refused([](ForeignUff& f) { f.denominator = 13; }), "no error");
  EXPECT_NE(refused([](ForeignUff& f) { f.form = 5; }), "no error");
  EXPECT_NE(refused([](ForeignUff& f) { f.y.push_back(std::nan("")); }), "no error");
  // A node with both is read for its displacements; one with two of them is not.
  ForeignUff f, a;
  a.ordinate = 12;
  EXPECT_EQ(ReadUffText(a.Node() + f.Node()).size(), 3U);
  EXPECT_NE(ErrorOf([&] { ReadUffText(f.Node() + f.Node()); }).find("two functions of x"),
            std::string::npos);
}

TEST(Uff, CountsThatTheFileDoesNotHold) {
  const std::string text = ForeignUff().Node();
  for (const char* count : {"-3", "1999999999", "9999999999", "3.5", "nan", "1e9"}) {
    std::string changed = text;
    char field[32];
    std::snprintf(field, sizeof field, "%10s", count);
    changed.replace(changed.find("         2         3") + 10, 10, field);
    EXPECT_NE(ErrorOf([&] { ReadUffText(changed); }), "no error") << count;
  }
  ForeignUff binary;
  binary.binary = "le";
  std::string changed = binary.Node();
  changed.replace(changed.find("          12"), 12, "  2000000000");
  EXPECT_NE(ErrorOf([&] { ReadUffText(changed); }).find("cut off"), std::string::npos);
}

}  // namespace
}  // namespace unfurl::data::tracks_uff_test
