#include "data/uff.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "base/error.h"
#include "base/text.h"
#include "data/atomic_file.h"
#include "data/rounded_stamps.h"

namespace unfurl::data {

namespace {

static_assert(std::endian::native == std::endian::little);

// The format's codes of a data type.
constexpr int kSingle = 2, kDouble = 4, kComplexSingle = 5, kComplexDouble = 6;
constexpr int kAsciiLines = 11;  // of a dataset 58, before its values

// Lines and bytes of a file, with the line's number for messages.
class Scanner {
 public:
  Scanner(const std::string& path, std::string_view text) : path_(path), text_(text) {}

  bool Next(std::string* line) {
    if (at_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', at_), text_.size());
    *line = std::string(text_.substr(at_, end - at_));
    if (!line->empty() && line->back() == '\r') line->pop_back();
    at_ = end + 1;
    ++number_;
    return true;
  }
  std::string Need() {
    std::string line;
    if (!Next(&line)) Fail("is cut off");
    return line;
  }
  std::string_view Bytes(std::size_t count) {
    if (at_ > text_.size() || count > text_.size() - at_) Fail("is cut off");
    at_ += count;
    return text_.substr(at_ - count, count);
  }
  std::size_t left() const { return at_ < text_.size() ? text_.size() - at_ : 0; }
  std::string where() const { return fmt::format("{}:{}", path_, number_); }
  [[noreturn]] void Fail(const std::string& what) const {
    throw Error(what, where(), "export it again");
  }

  // Columns [first, first + width) of a line.
  static std::string_view Field(std::string_view line, std::size_t first, std::size_t width) {
    return first < line.size() ? Trim(line.substr(first, width)) : std::string_view();
  }
  double Number(std::string_view line, std::size_t first, std::size_t width) const {
    std::string field(Field(line, first, width));
    std::replace(field.begin(), field.end(), 'D', 'E');  // Fortran's doubles
    double value = 0.0;
    if (!ParseDouble(field, &value) || !std::isfinite(value)) {
      Fail(fmt::format("'{}' is no finite number", field));
    }
    return value;
  }
  int Integer(std::string_view line, std::size_t first, std::size_t width) const {
    const double value = Number(line, first, width);
    if (value != std::floor(value) || std::abs(value) > 2e9) {
      Fail(fmt::format("{} is no whole number in range", value));
    }
    return static_cast<int>(value);
  }

 private:
  const std::string& path_;
  std::string_view text_;
  std::size_t at_ = 0, number_ = 0;
};

UffAxis ReadAxis(Scanner& in) {
  const std::string line = in.Need();
  return {in.Integer(line, 0, 10), std::string(Scanner::Field(line, 26, 20)),
          std::string(Scanner::Field(line, 47, 20))};
}

// How the values of a function follow each other.
struct UffForm {
  int type = 0;
  std::size_t count = 0;
  bool even = false;
  double start = 0.0, step = 0.0;
  bool wide() const { return type == kDouble; }
};

UffForm ReadForm(Scanner& in) {
  const std::string line = in.Need();
  UffForm form;
  form.type = in.Integer(line, 0, 10);
  const int count = in.Integer(line, 10, 10);
  form.even = in.Integer(line, 20, 10) == 1;
  form.start = in.Number(line, 30, 13);
  form.step = in.Number(line, 43, 13);
  if (form.type != kSingle && form.type != kDouble && form.type != kComplexSingle &&
      form.type != kComplexDouble) {
    in.Fail(fmt::format("there is no data type {}", form.type));
  }
  if (count < 0 || static_cast<std::size_t>(count) > in.left()) {
    in.Fail(fmt::format("counts {} values, and the file holds {} bytes more", count, in.left()));
  }
  if (form.even && !(form.step > 0.0)) in.Fail("its abscissa does not rise");
  form.step = UnroundedStep(form.step, RoundingOfE5(form.step));
  form.count = static_cast<std::size_t>(count);
  return form;
}

void ReadAscii(Scanner& in, const UffForm& form, UffFunction* f) {
  const std::size_t need = form.even ? form.count : 2 * form.count;
  std::vector<double> values;
  values.reserve(need);
  while (values.size() < need) {
    const std::string line = in.Need();
    if (Trim(line) == "-1") in.Fail(fmt::format("has {} of {} values", values.size(), need));
    for (std::size_t at = 0; at < line.size() && values.size() < need;) {
      const bool ordinate = form.even || values.size() % 2 == 1;
      const std::size_t width = form.wide() && ordinate ? 20 : 13;
      if (Trim(std::string_view(line).substr(at)).empty()) break;
      values.push_back(in.Number(line, at, width));
      at += width;
    }
  }
  for (std::size_t i = 0; i < form.count; ++i) {
    f->t.push_back(form.even ? form.start + form.step * static_cast<double>(i) : values[2 * i]);
    f->y.push_back(form.even ? values[i] : values[2 * i + 1]);
  }
  if (!form.even) RestoreGrid(&f->t, RoundingOfE5);
}

template <typename Word, typename Value>
double Unpack(std::string_view bytes, bool big) {
  Word word = 0;
  for (std::size_t k = 0; k < sizeof(Word); ++k) {
    const std::size_t from = big ? sizeof(Word) - 1 - k : k;
    word |= static_cast<Word>(static_cast<unsigned char>(bytes[from])) << (8 * k);
  }
  Value value;
  std::memcpy(&value, &word, sizeof value);
  return static_cast<double>(value);
}

void ReadBinary(Scanner& in, const UffForm& form, bool big, std::size_t bytes, UffFunction* f) {
  const std::size_t y_width = form.wide() ? 8 : 4;
  std::size_t t_width = 0;
  if (!form.even && form.count > 0) {
    // Writers differ in how wide the abscissa of doubles is.
    t_width = bytes / form.count >= 2 * y_width ? y_width : 4;
  }
  const std::size_t row = t_width + y_width;
  if (bytes < row * form.count) {
    in.Fail(fmt::format("{} bytes hold no {} values", bytes, form.count));
  }
  const std::string_view block = in.Bytes(bytes);
  const auto unpack = [&](std::size_t at, std::size_t width) {
    const std::string_view from = block.substr(at, width);
    const double value = width == 8 ? Unpack<std::uint64_t, double>(from, big)
                                    : Unpack<std::uint32_t, float>(from, big);
    if (!std::isfinite(value)) in.Fail("a value is not finite");
    return value;
  };
  for (std::size_t i = 0; i < form.count; ++i) {
    f->t.push_back(form.even ? form.start + form.step * static_cast<double>(i)
                             : unpack(row * i, t_width));
    f->y.push_back(unpack(row * i + t_width, y_width));
  }
  if (t_width == 4) RestoreGrid(&f->t, RoundingOfFloat);
}

void SkipToEnd(Scanner& in) {
  while (Trim(in.Need()) != "-1") {
  }
}

// What stands after the number of a dataset 58b: byte order, format, bytes of the values.
struct Binary {
  bool here = false, big = false;
  std::size_t bytes = 0;
};

Binary ReadBinaryHead(const Scanner& in, const std::string& line) {
  Binary binary;
  binary.here = line.size() > 6 && (line[6] == 'b' || line[6] == 'B');
  if (!binary.here) return binary;
  const int order = in.Integer(line, 7, 6), format = in.Integer(line, 13, 6);
  const int lines = in.Integer(line, 19, 12), bytes = in.Integer(line, 31, 12);
  if ((order != 1 && order != 2) || format != 2) {
    in.Fail("its binary numbers are not in IEEE format");
  }
  if (lines != kAsciiLines || bytes < 0) in.Fail("is no dataset 58b");
  binary.big = order == 2;
  binary.bytes = static_cast<std::size_t>(bytes);
  return binary;
}

// A dataset 58 after its number; up to and with its closing -1.
UffFunction ReadFunction(Scanner& in, const Binary& binary) {
  UffFunction f;
  f.where = in.where();
  for (std::string& id : f.id) id = std::string(Trim(in.Need()));
  const std::string entity = in.Need();
  f.type = in.Integer(entity, 0, 5);
  f.node = in.Integer(entity, 41, 10);
  f.direction = in.Integer(entity, 51, 4);
  const UffForm form = ReadForm(in);
  f.abscissa = ReadAxis(in);
  f.ordinate = ReadAxis(in);
  f.denominator = ReadAxis(in);
  in.Need();  // the axis of spectra in three dimensions
  f.complex = form.type == kComplexSingle || form.type == kComplexDouble;
  if (f.complex) {
    if (binary.here) in.Bytes(binary.bytes);
    SkipToEnd(in);
    return f;
  }
  if (binary.here) {
    ReadBinary(in, form, binary.big, binary.bytes, &f);
    std::string rest = in.Need();  // of the line that the values end on, which may be empty
    if (Trim(rest).empty()) rest = in.Need();
    if (Trim(rest) != "-1") in.Fail("a dataset does not end where it should");
    return f;
  }
  ReadAscii(in, form, &f);
  if (Trim(in.Need()) != "-1") in.Fail("a dataset does not end where it should");
  return f;
}

// Dataset 164: a code with its name, and factors from SI to the file's units.
double ReadLengthFactor(Scanner& in) {
  struct Known {
    int code;
    double factor;  // lengths per metre
  };
  constexpr double kFoot = 0.3048, kInch = 0.0254;  // [m]
  constexpr Known kKnown[] = {{1, 1.0}, {2, 1.0 / kFoot}, {3, 1.0}, {4, 1.0 / kFoot}, {5, 1e3},
                              {6, 1e2}, {7, 1.0 / kInch}, {8, 1e3}, {10, 1e3}};
  const int code = in.Integer(in.Need(), 0, 10);
  const double factor = in.Number(in.Need(), 0, 25);
  if (!(factor > 0.0)) in.Fail(fmt::format("{} is no factor of lengths", factor));
  for (const Known& known : kKnown) {
    if (known.code == code && std::abs(factor / known.factor - 1.0) > 1e-3) {
      in.Fail(fmt::format("units of code {} have {:g} lengths to the metre, and not {:g}", code,
                          known.factor, factor));
    }
  }
  SkipToEnd(in);
  return factor;
}

}  // namespace

UffFile ReadUff(const std::string& path) {
  const std::string text = ReadTextFile(path);
  Scanner in(path, text);
  UffFile file;
  std::string line;
  while (in.Next(&line)) {
    if (Trim(line) != "-1") continue;
    if (!in.Next(&line)) break;
    const std::string_view number = Scanner::Field(line, 0, 6);
    if (number == "58") {
      file.functions.push_back(ReadFunction(in, ReadBinaryHead(in, line)));
    } else if (number == "164") {
      const double factor = ReadLengthFactor(in);
      if (file.length_factor > 0.0 && factor != file.length_factor) {
        in.Fail("states its units twice, and not the same");
      }
      file.length_factor = factor;
    } else {
      while (in.Next(&line) && Trim(line) != "-1") {
      }
    }
  }
  return file;
}

std::string UffDataType(int type) {
  switch (type) {
    case 8:
      return "displacement";
    case 9:
    case 13:
      return "force";
    case 11:
      return "velocity";
    case 12:
      return "acceleration";
    case 17:
      return "time";
    case 18:
      return "frequency";
    default:
      return fmt::format("data type {}", type);
  }
}

std::string UffFunctionType(int type) {
  switch (type) {
    case 0:
      return "function";
    case 1:
      return "time response";
    case 2:
      return "auto spectrum";
    case 3:
      return "cross spectrum";
    case 4:
      return "frequency response";
    case 6:
      return "coherence";
    default:
      return fmt::format("function of type {}", type);
  }
}

}  // namespace unfurl::data
