// Tracks as C3D.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>

#include "data/atomic_file.h"
#include "data/tracks_exchange.h"
#include "strobed_tracks.h"
#include "tests/data/errors.h"

namespace unfurl::data::tracks_c3d_test {
namespace {

TEST(C3d, ThereAndBack) {
  const Tracks tracks = Strobed();
  const Tracks back = ThereAndBack(".c3d", tracks, WriteTracksC3d, ReadTracksC3d);
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
  const std::string path = ExchangePath("bytes.c3d");
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

// 32 bits of millimetres: 5 km off, coordinates are rounded to half a millimetre, which the stated
// error has to hold; 500 km off, in a surveyor's grid, to 32 mm, and nothing is left of them.
TEST(C3d, RoundsNoFartherThanItSays) {
  const std::string path = ExchangePath("far.c3d");
  Tracks tracks = Strobed();
  tracks.p.row(0).array() += 5000.0;
  for (Eigen::Index i = 0; i < tracks.cov.cols(); ++i) {
    tracks.cov.col(i) << 4e-8, 0, 0, 4e-8, 0, 4e-8;
  }
  WriteTracksC3d(path, tracks);
  const Tracks back = ReadTracksC3d(path);
  for (std::size_t i = 0; i < back.size(); ++i) {
    if (!Usable(back.status[i])) continue;
    const double sigma = std::sqrt(back.Covariance(i)(0, 0));
    EXPECT_GE(sigma, std::hypot(2e-4, 0.5e-3 / std::sqrt(12.0)) - 1e-9);
    EXPECT_LT(sigma, 2.6e-4);
  }
  tracks.p.row(0).array() += 495e3;
  EXPECT_NE(ErrorOf([&] { WriteTracksC3d(path, tracks); }).find("32 mm"), std::string::npos);
}

// Errors of centimetres need another unit of residuals than hundredths of a millimetre.
TEST(C3d, KeepsLargeErrors) {
  const std::string path = ExchangePath("large.c3d");
  Tracks tracks = Strobed();
  for (Eigen::Index i = 0; i < tracks.cov.cols(); ++i) {
    const double v = i % 2 == 0 ? 9e-4 : 1e-8;  // 30 mm, 0.1 mm
    tracks.cov.col(i) << v, 0, 0, v, 0, v;
  }
  WriteTracksC3d(path, tracks);
  const Tracks back = ReadTracksC3d(path);
  double least = 1.0, most = 0.0;
  for (std::size_t i = 0; i < back.size(); ++i) {
    if (!Usable(back.status[i])) continue;
    const double sigma = std::sqrt(back.Covariance(i)(0, 0));
    least = std::min(least, sigma);
    most = std::max(most, sigma);
  }
  EXPECT_NEAR(most, 0.03, 1e-6);
  EXPECT_GE(least, 1e-4);
  EXPECT_LT(least, 2.5e-4);
}

TEST(C3d, RefusesWhatItCannotHold) {
  Tracks tracks = Strobed();
  tracks.t[6] += 0.002;
  EXPECT_NE(ErrorOf([&] { WriteTracksC3d(ExchangePath(".c3d"), tracks); }).find("grid"),
            std::string::npos);
  const std::string path = ExchangePath("bad.c3d");
  WriteTracksC3d(path, Strobed());
  const std::string text = ReadTextFile(path);
  WriteTextFile(path, text.substr(0, text.size() - 700));
  EXPECT_NE(ErrorOf([&] { ReadTracksC3d(path); }).find("cut off"), std::string::npos);
  WriteTextFile(path, "no C3D at all");
  EXPECT_NE(ErrorOf([&] { ReadTracksC3d(path); }).find("no C3D"), std::string::npos);
  std::remove(path.c_str());
}

TEST(C3d, CountsThatTheFileDoesNotHold) {
  const std::string path = ExchangePath("counts.c3d");
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

}  // namespace
}  // namespace unfurl::data::tracks_c3d_test
