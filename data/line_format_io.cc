#include "data/line_format_io.h"

#include <fmt/format.h>

#include <array>
#include <cstdint>
#include <utility>

namespace unfurl::data {

namespace {

constexpr char kGroup[] = "/line_formats";  // of cameras that differ
constexpr double kLargest = 1e12;           // beyond, a number is a mistake

std::string AttributeOf(const LineFormatReal& real) {
  return fmt::format("{} [{}]", real.name, real.unit);
}

// Takes a number into the format, or throws.
void Take(const H5Reader& reader, const std::string& object, const LineFormatWhole& whole,
          std::int64_t value, LineFormat* format) {
  if (value < whole.low || value > whole.high) {
    reader.Fail(
        fmt::format("{} = {} is not from {} to {}", whole.name, value, whole.low, whole.high),
        object, "make the file again");
  }
  format->*whole.member = static_cast<int>(value);
}
void Take(const H5Reader& reader, const std::string& object, const LineFormatReal& real,
          double value, LineFormat* format) {
  if (!(real.zero ? value >= 0.0 : value > 0.0) || value > kLargest) {
    reader.Fail(fmt::format("{} = {} is impossible", AttributeOf(real), value), object,
                "make the file again");
  }
  format->*real.member = value;
}

LineFormat ReadOne(const H5Reader& reader, const std::string& object) {
  LineFormat format;
  format.sensor = reader.StringAttribute(object, "sensor");
  for (const LineFormatWhole& whole : kLineFormatWhole) {
    Take(reader, object, whole, reader.IntAttribute(object, whole.name), &format);
  }
  for (const LineFormatReal& real : kLineFormatReal) {
    Take(reader, object, real, reader.DoubleAttribute(object, AttributeOf(real)), &format);
  }
  return format;
}

std::vector<LineFormat> ReadEach(const H5Reader& reader, std::size_t cameras) {
  const auto path = [](const char* name) { return fmt::format("{}/{}", kGroup, name); };
  std::vector<LineFormat> formats(cameras);
  const auto check = [&](const std::string& dataset, std::size_t size) {
    if (size == cameras) return;
    reader.Fail(fmt::format("holds {} entries for {} cameras", size, cameras), dataset,
                "make the file again");
  };
  const std::vector<std::string> sensors = reader.ReadStrings(path("sensor"));
  check(path("sensor"), sensors.size());
  for (std::size_t c = 0; c < cameras; ++c) formats[c].sensor = sensors[c];
  for (const LineFormatWhole& whole : kLineFormatWhole) {
    const std::vector<std::int32_t> values = reader.ReadInts(path(whole.name));
    check(path(whole.name), values.size());
    for (std::size_t c = 0; c < cameras; ++c) {
      Take(reader, path(whole.name), whole, values[c], &formats[c]);
    }
  }
  for (const LineFormatReal& real : kLineFormatReal) {
    const std::vector<double> values = reader.ReadDoubles(path(real.name), real.unit);
    check(path(real.name), values.size());
    for (std::size_t c = 0; c < cameras; ++c) {
      Take(reader, path(real.name), real, values[c], &formats[c]);
    }
  }
  return formats;
}

}  // namespace

std::vector<std::size_t> LineDims(const LineFormats& formats, std::size_t cameras) {
  if (formats.by_camera.empty()) return {cameras, formats.elements()};
  return {formats.ElementsBefore(cameras)};
}

void WriteLineFormats(H5Writer& writer, const std::string& object, const LineFormats& formats) {
  if (formats.by_camera.empty()) {
    writer.Attribute(object, "sensor", formats.sensor);
    for (const LineFormatWhole& whole : kLineFormatWhole) {
      writer.Attribute(object, whole.name, static_cast<std::int64_t>(formats.*whole.member));
    }
    for (const LineFormatReal& real : kLineFormatReal) {
      writer.Attribute(object, AttributeOf(real), formats.*real.member);
    }
    return;
  }
  const auto field = [](const char* name, const char* unit) {
    return H5Field{fmt::format("{}/{}", kGroup, name), unit, "of each camera's lines"};
  };
  std::vector<std::string> sensors;
  for (const LineFormat& format : formats.by_camera) sensors.push_back(format.sensor);
  writer.Write(field("sensor", "1"), sensors);
  for (const LineFormatWhole& whole : kLineFormatWhole) {
    std::vector<std::int32_t> values;
    for (const LineFormat& format : formats.by_camera) values.push_back(format.*whole.member);
    writer.Write(field(whole.name, "1"), values);
  }
  for (const LineFormatReal& real : kLineFormatReal) {
    std::vector<double> values;
    for (const LineFormat& format : formats.by_camera) values.push_back(format.*real.member);
    writer.Write(field(real.name, real.unit), values);
  }
}

LineFormats ReadLineFormats(const H5Reader& reader, const std::string& object,
                            std::size_t cameras) {
  const std::vector<std::size_t> dims = reader.Dims(object);
  LineFormats formats;
  if (dims.size() == 3) {
    static_cast<LineFormat&>(formats) = ReadOne(reader, object);
  } else if (dims.size() == 2) {
    formats.by_camera = ReadEach(reader, cameras);
    if (!formats.by_camera.empty()) static_cast<LineFormat&>(formats) = formats.by_camera[0];
  } else {
    reader.Fail("is neither line x camera x element nor line x elements of all cameras", object,
                "make the file again");
  }
  std::vector<std::size_t> expected = LineDims(formats, cameras);
  expected.insert(expected.begin(), dims[0]);
  if (dims != expected) {
    reader.Fail(fmt::format("has lines of {} counts, but {} cameras and their layouts ask for {}",
                            dims.size() == 3 ? dims[1] * dims[2] : dims[1], cameras,
                            formats.ElementsBefore(cameras)),
                object, "make the file again");
  }
  return formats;
}

void WriteResponse(H5Writer& writer, std::span<const float> response, std::size_t cameras,
                   const LineFormats& formats) {
  if (response.empty()) return;
  const std::vector<double> values(response.begin(), response.end());
  std::vector<std::size_t> dims = {values.size()};
  if (formats.by_camera.empty()) dims = {cameras, static_cast<std::size_t>(formats.active)};
  writer.Write({"/response", "1", "flat field: response of each active pixel over the mean"},
               values, dims);
}

std::vector<float> ReadResponse(const H5Reader& reader, std::size_t cameras,
                                const LineFormats& formats) {
  if (!reader.Has("/response")) return {};
  std::vector<std::size_t> expected = {formats.ActiveBefore(cameras)};
  if (formats.by_camera.empty()) expected = {cameras, static_cast<std::size_t>(formats.active)};
  if (reader.Dims("/response") != expected) {
    reader.Fail("does not hold one number per camera and active pixel", "/response",
                "make the file again");
  }
  const std::vector<double> values = reader.ReadDoubles("/response");
  for (std::size_t c = 0; c < cameras; ++c) {
    const std::size_t first = formats.ActiveBefore(c);
    for (std::size_t i = first; i < formats.ActiveBefore(c + 1); ++i) {
      if (values[i] >= kLowestResponse && values[i] <= kHighestResponse) continue;
      reader.Fail(
          fmt::format("the response of pixel {} of camera {} is {}", i - first, c, values[i]),
          "/response", "record the flat field again, evenly lit and not saturated");
    }
  }
  return {values.begin(), values.end()};
}

}  // namespace unfurl::data
