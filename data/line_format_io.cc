#include "data/line_format_io.h"

#include <fmt/format.h>

namespace unfurl::data {

void WriteLineFormat(H5Writer& writer, const std::string& object, const LineFormat& format) {
  writer.Attribute(object, "sensor", format.sensor);
  const auto whole = [&](const char* name, int value) {
    writer.Attribute(object, name, static_cast<std::int64_t>(value));
  };
  whole("dummy", format.dummy);
  whole("dark", format.dark);
  whole("active", format.active);
  whole("dark_after", format.dark_after);
  whole("parity", format.parity);
  whole("bits", format.bits);
  writer.Attribute(object, "pitch [m]", format.pitch);
  writer.Attribute(object, "electrons_per_count [e-/count]", format.electrons_per_count);
  writer.Attribute(object, "read_noise_counts [count]", format.read_noise_counts);
}

LineFormat ReadLineFormat(const H5Reader& reader, const std::string& object, std::size_t elements) {
  LineFormat format;
  format.sensor = reader.StringAttribute(object, "sensor");
  const auto whole = [&](const char* name, int low, int high) {
    const std::int64_t value = reader.IntAttribute(object, name);
    if (value < low || value > high) {
      reader.Fail(fmt::format("{} = {} is not from {} to {}", name, value, low, high), object,
                  "make the file again");
    }
    return static_cast<int>(value);
  };
  format.dummy = whole("dummy", 0, 1000);
  format.dark = whole("dark", 0, 1000);
  format.active = whole("active", 16, 100000);
  format.dark_after = whole("dark_after", 0, 1000);
  format.parity = whole("parity", 0, 1000);
  format.bits = whole("bits", 1, 16);
  const auto positive = [&](const char* name, bool zero) {
    const double value = reader.DoubleAttribute(object, name);
    if (!(zero ? value >= 0.0 : value > 0.0) || value > 1e12) {
      reader.Fail(fmt::format("{} = {} is impossible", name, value), object, "make the file again");
    }
    return value;
  };
  format.pitch = positive("pitch [m]", false);
  format.electrons_per_count = positive("electrons_per_count [e-/count]", false);
  format.read_noise_counts = positive("read_noise_counts [count]", true);
  if (format.elements() != elements) {
    reader.Fail(
        fmt::format("lines of {} elements, but the layout has {}", elements, format.elements()),
        object, "make the file again");
  }
  return format;
}

void WriteResponse(H5Writer& writer, std::span<const float> response, std::size_t cameras,
                   const LineFormat& format) {
  if (response.empty()) return;
  const std::vector<double> values(response.begin(), response.end());
  writer.Write({"/response", "1", "flat field: response of each active pixel over the mean"},
               values, {cameras, static_cast<std::size_t>(format.active)});
}

std::vector<float> ReadResponse(const H5Reader& reader, std::size_t cameras,
                                const LineFormat& format) {
  constexpr double kLowest = 0.05, kHighest = 20.0;  // beyond, a pixel is broken or the record is
  if (!reader.Has("/response")) return {};
  const std::vector<std::size_t> expected = {cameras, static_cast<std::size_t>(format.active)};
  if (reader.Dims("/response") != expected) {
    reader.Fail("does not hold one number per camera and active pixel", "/response",
                "make the file again");
  }
  const std::vector<double> values = reader.ReadDoubles("/response");
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= kLowest && values[i] <= kHighest)) {
      reader.Fail(fmt::format("the response of pixel {} of camera {} is {}", i % expected[1],
                              i / expected[1], values[i]),
                  "/response", "record the flat field again, evenly lit and not saturated");
    }
  }
  return {values.begin(), values.end()};
}

}  // namespace unfurl::data
