#include "data/channels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "base/error.h"
#include "base/text.h"
#include "data/csv.h"
#include "data/formats.h"
#include "data/h5.h"
#include "data/rounded_stamps.h"
#include "data/run.h"
#include "data/uff.h"
#include "data/units.h"

namespace unfurl::data {

namespace {

constexpr char kChannelsSigma[] = ".sigma";

// Long rows, of any file, gathered by the channel that they name.
class Gathered {
 public:
  void Add(const std::string& name, const std::string& unit, const std::string& where, double t,
           double y, double sigma) {
    const auto [at, fresh] = index_.try_emplace(name, channels_.size());
    if (fresh) channels_.push_back({name, unit, where, {}, {}, {}});
    Channel& c = channels_[at->second];
    if (c.unit != unit) {
      throw Error(fmt::format("'{}' is in '{}' here and in '{}' before", name, unit, c.unit), where,
                  "write each channel in one unit");
    }
    c.t.push_back(t);
    c.y.push_back(y);
    if (!std::isnan(sigma)) c.sigma.push_back(sigma);
  }
  std::vector<Channel> Take() { return std::move(channels_); }

 private:
  std::map<std::string, std::size_t> index_;
  std::vector<Channel> channels_;
};

// Times of a table, in s.
class Times {
 public:
  explicit Times(const CsvTable& table) : table_(table), column_(table.Find("t")) {
    const std::string unit =
        column_ < 0 ? "" : table.columns()[static_cast<std::size_t>(column_)].unit;
    const auto factor = UnitsPer("s", unit);
    if (column_ < 0 || !factor) {
      table.Require("t", "s");  // says what is wrong with it
      throw Error("its times have no unit of time", table.path(), "name the column 't [s]'");
    }
    factor_ = *factor;
  }
  double At(std::size_t row) const { return factor_ * table_.Number(row, column_); }
  int column() const { return column_; }

 private:
  const CsvTable& table_;
  int column_;
  double factor_ = 1.0;
};

std::vector<Channel> LongCsv(const CsvTable& table) {
  const Times times(table);
  const int name = table.Require("channel", ""), unit = table.Find("unit");
  const int value = table.Find("value"), sigma = table.Find("sigma");
  const std::string stated = table.columns()[static_cast<std::size_t>(value)].unit;
  Gathered out;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    out.Add(table.Text(row, name), unit >= 0 ? table.Text(row, unit) : stated,
            table.Where(row, value), times.At(row), table.Number(row, value),
            sigma >= 0 ? table.NumberOrNan(row, sigma) : std::nan(""));
  }
  return out.Take();
}

std::vector<Channel> WideCsv(const CsvTable& table) {
  const Times times(table);
  std::vector<Channel> out;
  for (int c = 0; c < static_cast<int>(table.columns().size()); ++c) {
    const CsvColumn& column = table.columns()[static_cast<std::size_t>(c)];
    if (c == times.column() || column.name.ends_with(kChannelsSigma)) continue;
    const int sigma = table.Find(column.name + kChannelsSigma);
    Channel channel{column.name, column.unit, table.Where(0, c), {}, {}, {}};
    for (std::size_t row = 0; row < table.rows(); ++row) {
      if (table.Empty(row, c)) continue;
      channel.t.push_back(times.At(row));
      channel.y.push_back(table.Number(row, c));
      if (sigma >= 0 && !table.Empty(row, sigma)) {
        channel.sigma.push_back(table.Number(row, sigma));
      }
    }
    out.push_back(std::move(channel));
  }
  return out;
}

std::vector<Channel> FromCsv(const std::string& path) {
  const CsvTable table = CsvTable::Load(path);
  if (table.rows() == 0) throw Error("holds no readings", path, "give a table with rows");
  const bool is_long = table.Find("channel") >= 0 && table.Find("value") >= 0;
  std::vector<Channel> channels = is_long ? LongCsv(table) : WideCsv(table);
  for (Channel& channel : channels) RestoreDecimals(&channel.t);
  return channels;
}

// "12+x" of node 12 along x.
std::string DirectionOf(const UffFunction& f) {
  const int axis = std::abs(f.direction);
  if (axis < 1 || axis > 3) return fmt::format("{}", f.node);
  return fmt::format("{}{}{}", f.node, f.direction < 0 ? '-' : '+', "xyz"[axis - 1]);
}

std::vector<Channel> FromUff(const std::string& path) {
  constexpr int kTime = 17;  // data type of the abscissa
  const UffFile file = ReadUff(path);
  std::vector<Channel> out;
  std::map<std::string, int> named;
  for (const UffFunction& f : file.functions) ++named[f.id[0]];
  for (const UffFunction& f : file.functions) {
    if (f.complex || f.abscissa.type != kTime) continue;
    Channel c;
    c.where = f.where;
    // A title of its own is the channel's name; one that many bear says nothing.
    const bool own = !f.id[0].empty() && f.id[0] != "NONE" && named[f.id[0]] == 1;
    c.name = own ? f.id[0] : DirectionOf(f);
    if (f.ordinate.units != "NONE") c.unit = f.ordinate.units;
    const std::string& time = f.abscissa.units;
    const auto factor = time.empty() || time == "NONE"
                            ? 1.0
                            : UnitsPer("s", time == "sec" || time == "S" ? "s" : time);
    if (!factor) {
      throw Error(fmt::format("its times are in '{}'", time), f.where, "export them in s");
    }
    c.t = f.t;
    for (double& t : c.t) t *= *factor;
    c.y = f.y;
    out.push_back(std::move(c));
  }
  if (out.empty()) throw Error("holds no function over time", path, "export time responses");
  return out;
}

std::vector<Channel> FromRun(const Run& run, const std::string& path) {
  std::vector<Channel> out;
  for (std::size_t q = 0; q < run.quantities.size(); ++q) {
    out.push_back(
        {run.quantities[q].name, run.quantities[q].units, path, run.t, run.columns[q], {}});
  }
  return out;
}

std::vector<Channel> LongH5(const H5Reader& file) {
  const std::vector<double> t = file.ReadDoubles("t"), y = file.ReadDoubles("value");
  const std::vector<std::string> name = file.ReadStrings("channel");
  const auto units = file.Has("unit") ? file.ReadStrings("unit")
                                      : std::vector<std::string>(t.size(), file.Units("value"));
  const auto sigma =
      file.Has("sigma") ? file.ReadDoubles("sigma") : std::vector<double>(t.size(), std::nan(""));
  for (const std::size_t size : {y.size(), name.size(), units.size(), sigma.size()}) {
    if (size == t.size()) continue;
    file.Fail("t, channel, value, unit and sigma differ in length", "/t", "write a row a reading");
  }
  Gathered out;
  for (std::size_t i = 0; i < t.size(); ++i) {
    out.Add(name[i], units[i], file.path() + ":/value", t[i], y[i], sigma[i]);
  }
  return out.Take();
}

std::vector<Channel> FromH5(const std::string& path) {
  const H5Reader file(path, "", 0);
  if (file.HasAttribute("/", "schema") && file.StringAttribute("/", "schema") == kRunSchema) {
    return FromRun(ReadRun(path), path);
  }
  if (file.Has("t") && file.Has("channel") && file.Has("value")) return LongH5(file);
  std::vector<Channel> out;
  for (const std::string& group : file.Children("/")) {
    if (file.IsDataset(group) || !file.Has(group + "/t") || !file.Has(group + "/value")) continue;
    Channel c;
    c.name = group;
    c.where = fmt::format("{}:/{}", path, group);
    c.t = file.ReadDoubles(group + "/t");
    c.y = file.ReadDoubles(group + "/value");
    c.unit = file.Units(group + "/value");
    if (file.Has(group + "/sigma")) c.sigma = file.ReadDoubles(group + "/sigma");
    if (c.y.size() != c.t.size() || (!c.sigma.empty() && c.sigma.size() != c.t.size())) {
      file.Fail("t, value and sigma differ in length", group, "write an entry a reading");
    }
    out.push_back(std::move(c));
  }
  if (out.empty()) {
    throw Error("holds no channels", path,
                "write a group each with datasets t and value, or a run of ours");
  }
  return out;
}

}  // namespace

void CheckChannel(const Channel& c) {
  if (c.y.size() != c.t.size()) {
    throw Error(fmt::format("'{}' has {} readings at {} stamps", c.name, c.y.size(), c.t.size()),
                c.where, "give a stamp for each");
  }
  if (!c.sigma.empty() && c.sigma.size() != c.t.size()) {
    throw Error(
        fmt::format("'{}' has a sigma for {} of {} readings", c.name, c.sigma.size(), c.t.size()),
        c.where, "give one to each, or to none");
  }
  for (std::size_t i = 0; i < c.t.size(); ++i) {
    const bool good = std::isfinite(c.t[i]) && std::isfinite(c.y[i]) &&
                      (c.sigma.empty() || (std::isfinite(c.sigma[i]) && c.sigma[i] > 0.0));
    if (!good) {
      throw Error(
          fmt::format("reading {} of '{}' is not finite, or its sigma not positive", i + 1, c.name),
          c.where, "leave readings that failed out");
    }
    if (i > 0 && !(c.t[i] > c.t[i - 1])) {
      throw Error(fmt::format("the stamps of '{}' do not ascend at {} s", c.name, c.t[i]), c.where,
                  "write each channel's readings in order of time, one per stamp");
    }
  }
}

std::vector<Channel> ReadChannels(const std::string& path) {
  return ReadChannels(path, FormatOf(path));
}

std::vector<Channel> ReadChannels(const std::string& path, FileFormat format) {
  std::vector<Channel> out;
  switch (format) {
    case FileFormat::kCsv:
      out = FromCsv(path);
      break;
    case FileFormat::kUff:
      out = FromUff(path);
      break;
    case FileFormat::kHdf5:
      out = FromH5(path);
      break;
    default:
      throw Error("no file of channels ends like this", path, "give .csv, .uff, .unv or .h5");
  }
  for (const Channel& c : out) CheckChannel(c);
  return out;
}

const Channel& FindChannel(const std::vector<Channel>& channels, const std::string& name,
                           const std::string& where) {
  std::vector<std::string> names;
  for (const Channel& c : channels) {
    if (c.name == name) return c;
    names.push_back(c.name);
  }
  const std::string nearest = NearestName(name, names);
  throw Error("the file has no channel '" + name + "'", where,
              nearest.empty() ? "it has " + JoinWords(names) : "did you mean '" + nearest + "'?");
}

}  // namespace unfurl::data
