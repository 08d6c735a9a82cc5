#include "data/tracks_exchange.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

#include "data/atomic_file.h"
#include "tests/data/errors.h"

namespace unfurl::data {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Three marks strobed at 200 Hz, 1 ms apart, as reconstructed; sample 7 of the second is missing.
Tracks Strobed() {
  Tracks tracks;
  tracks.frame = "rig";
  tracks.marks = {"mark1", "mark2", "mark3"};
  tracks.cameras = {"a", "b", "c", "d"};
  constexpr int kFrames = 20;
  tracks.p.resize(3, 3 * kFrames);
  tracks.cov.resize(6, 3 * kFrames);
  tracks.shared.resize(3, 0);
  for (int f = 0; f < kFrames; ++f) {
    for (int m = 0; m < 3; ++m) {
      const Eigen::Index i = 3 * f + m;
      const bool missing = f == 7 && m == 1;
      tracks.t.push_back(0.0005 + 0.005 * f + 0.001 * m);
      tracks.mark.push_back(m);
      tracks.status.push_back(missing  ? SampleStatus::kUnsolvable
                              : m == 2 ? SampleStatus::kThreeCameras
                                       : SampleStatus::kGood);
      tracks.used.push_back(missing ? 0U : m == 2 ? 7U : 15U);
      tracks.left_out.push_back(0);
      tracks.reason.push_back(missing ? SampleReason::kTooFew : SampleReason::kNone);
      tracks.p.col(i) = Eigen::Vector3d(0.1 * m - 1.0, 0.01 * f, 1e-4 * f * m);
      tracks.cov.col(i) << 4e-10, 1e-10, 0.0, 5e-10, -1e-10, 9e-10;
      if (!missing) continue;
      tracks.p.col(i).setConstant(kNan);
      tracks.cov.col(i).setConstant(kNan);
    }
  }
  return tracks;
}

std::string Name(const std::string& ending) {
  return testing::TempDir() + std::to_string(getpid()) + "exchange" + ending;
}

TEST(C3d, ThereAndBack) {
  const Tracks tracks = Strobed();
  const std::string path = Name(".c3d");
  WriteTracksC3d(path, tracks);
  const Tracks back = ReadTracksC3d(path);
  std::remove(path.c_str());
  ASSERT_EQ(back.size(), tracks.size());
  EXPECT_EQ(back.marks, tracks.marks);
  EXPECT_EQ(back.cameras, tracks.cameras);
  EXPECT_EQ(back.status, tracks.status);
  EXPECT_EQ(back.used, tracks.used);
  EXPECT_EQ(back.frame, "rig");
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    EXPECT_NEAR(back.t[i], tracks.t[i], 1e-12);
    EXPECT_EQ(back.mark[i], tracks.mark[i]);
    if (!Usable(tracks.status[i])) continue;
    const auto col = static_cast<Eigen::Index>(i);
    EXPECT_LT((back.p.col(col) - tracks.p.col(col)).norm(), 1.2e-7);  // 24 bits of a metre
    // The sigma in hundredths of a millimetre, rounded up.
    const double sigma = std::sqrt(tracks.Covariance(i).trace() / 3.0);
    EXPECT_GE(std::sqrt(back.cov(0, col)), sigma);
    EXPECT_LT(std::sqrt(back.cov(0, col)), sigma + 1.0001e-5);
  }
}

TEST(C3d, StandsByteByByteWhereTheFormatPutsIt) {
  // Read here by the format's own page, without our reader: header words, the data's block, the
  // first point's floats.
  const std::string path = Name("bytes.c3d");
  WriteTracksC3d(path, Strobed());
  const std::string text = ReadTextFile(path);
  std::remove(path.c_str());
  const auto word = [&](std::size_t number) {  // 16-bit words of the header, counted from 1
    std::uint16_t v;
    std::memcpy(&v, &text[2 * (number - 1)], 2);
    return v;
  };
  const auto real = [&](std::size_t at) {
    float v;
    std::memcpy(&v, &text[at], 4);
    return v;
  };
  EXPECT_EQ(text.size() % 512, 0U);
  EXPECT_EQ(word(1), 0x5002);
  EXPECT_EQ(word(2), 3);
  EXPECT_EQ(word(3), 0);
  EXPECT_EQ(word(4), 1);
  EXPECT_EQ(word(5), 20);
  EXPECT_LT(real(12), 0.0F);  // floating-point data
  EXPECT_FLOAT_EQ(real(20), 200.0F);
  const std::size_t data = 512U * (word(9) - 1U);
  EXPECT_EQ(static_cast<unsigned char>(text[512 + 3]), 84);
  EXPECT_EQ(static_cast<std::size_t>(static_cast<unsigned char>(text[512 + 2])) * 512 + 512, data);
  EXPECT_FLOAT_EQ(real(data), -1000.0F);  // mm
  EXPECT_EQ(static_cast<int>(real(data + 12)) / 256, 15);
  EXPECT_FLOAT_EQ(real(data + 16 * (7 * 3 + 1) + 12), -1.0F);
  EXPECT_NE(text.find("LABELS"), std::string::npos);
}

TEST(C3d, RefusesWhatItCannotHold) {
  Tracks tracks = Strobed();
  tracks.t[6] += 0.002;
  EXPECT_NE(ErrorOf([&] { WriteTracksC3d(Name(".c3d"), tracks); }).find("grid"), std::string::npos);
  const std::string path = Name("bad.c3d");
  WriteTracksC3d(path, Strobed());
  const std::string text = ReadTextFile(path);
  WriteTextFile(path, text.substr(0, text.size() - 700));
  EXPECT_NE(ErrorOf([&] { ReadTracksC3d(path); }).find("cut off"), std::string::npos);
  WriteTextFile(path, "no C3D at all");
  EXPECT_NE(ErrorOf([&] { ReadTracksC3d(path); }).find("no C3D"), std::string::npos);
  std::remove(path.c_str());
}

TEST(Uff, ThereAndBack) {
  const Tracks tracks = Strobed();
  const std::string path = Name(".uff");
  WriteTracksUff(path, tracks);
  const Tracks back = ReadTracksUff(path);
  std::remove(path.c_str());
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
  const std::string path = Name("other.uff");
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
  const std::string path = Name("foreign.uff");
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

TEST(C3d, CountsThatTheFileDoesNotHold) {
  const std::string path = Name("counts.c3d");
  WriteTracksC3d(path, Strobed());
  const std::string text = ReadTextFile(path);
  const auto with = [&](std::size_t at, std::uint16_t value) {
    std::string changed = text;
    std::memcpy(&changed[at], &value, 2);
    WriteTextFile(path, changed);
    return ErrorOf([&] { ReadTracksC3d(path); });
  };
  // The header's words count from 1: analogue values a frame, first and last frame, parameters.
  EXPECT_NE(with(4, 65535).find("cut off"), std::string::npos);
  EXPECT_NE(with(8, 65535).find("cut off"), std::string::npos);
  EXPECT_NE(with(8, 0).find("frames run from"), std::string::npos);
  EXPECT_NE(with(6, 999).find("frames run from"), std::string::npos);
  EXPECT_NE(with(0, 0x5000).find("no section of parameters"), std::string::npos);
  const auto parameter = [&](const char* name, std::size_t size, const void* value) {
    std::string changed = text;
    const std::size_t at = changed.find(name) + std::strlen(name) + 4;
    changed.replace(at, size, static_cast<const char*>(value), size);
    WriteTextFile(path, changed);
    return ErrorOf([&] { ReadTracksC3d(path); });
  };
  const std::uint16_t none = 0, many = 65535;
  EXPECT_NE(parameter("USED", 2, &none).find("POINT:USED"), std::string::npos);
  EXPECT_NE(parameter("USED", 2, &many).find("cut off"), std::string::npos);
  EXPECT_NE(parameter("DATA_START", 2, &none).find("POINT:DATA_START"), std::string::npos);
  EXPECT_NE(parameter("DATA_START", 2, &many).find("cut off"), std::string::npos);
  for (const float bad : {0.0F, -1.0F, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    EXPECT_NE(parameter("RATE", 4, &bad), "no error") << bad;
  }
  std::remove(path.c_str());
}

TEST(Tracks, HowSamplesCameAboutGoesThroughTheFile) {
  const Tracks tracks = Strobed();
  const std::string path = Name(".h5");
  WriteTracks(path, tracks, {});
  const Tracks back = ReadTracks(path);
  std::remove(path.c_str());
  EXPECT_EQ(back.cameras, tracks.cameras);
  EXPECT_EQ(back.used, tracks.used);
  EXPECT_EQ(back.left_out, tracks.left_out);
  EXPECT_EQ(back.reason, tracks.reason);
}

}  // namespace
}  // namespace unfurl::data
