#include "data/design.h"

#include <fmt/format.h>

#include "data/study_instrument.h"

namespace unfurl::data {

namespace {

DesignMark ReadMark(const std::string& name, const TomlTable& t) {
  DesignMark out;
  out.name = name;
  out.where = t.Where();
  out.set.push_back(fmt::format("mark.{}.on=\"{}\"", name, t.String("on")));
  if (t.Has("point")) {
    const std::vector<double> point = t.Numbers("point", 2);
    out.set.push_back(fmt::format("mark.{}.point=[{}, {}]", name, point[0], point[1]));
  }
  return out;
}

DesignChannel ReadChannel(const std::string& name, const TomlTable& t) {
  DesignChannel out;
  out.channel.name = name;
  out.channel.column = name;
  out.channel.at = t.Where();
  if (t.Has("event")) {
    ReadSwitch(t, &out.channel);
    out.channel.sigma = t.Number("sigma", kPositive);
    return out;
  }
  ReadInstrument(t, &out.channel);
  out.rate = t.Number("rate", kPositive);
  if (!(out.channel.sigma > 0.0)) t.FailMissing("sigma");
  return out;
}

Design ReadDesignFrom(const TomlTable& root, const std::string& path) {
  Design out;
  out.path = path;
  for (const auto& [name, table] : root.NamedTables("mark")) {
    out.marks.push_back(ReadMark(name, table));
  }
  for (const auto& [name, table] : root.NamedTables("channel")) {
    out.channels.push_back(ReadChannel(name, table));
  }
  for (const auto& [name, table] : root.NamedTables("trial")) {
    out.trials.push_back({name, table.Strings("set"), table.Where()});
  }
  root.RefuseUnknownKeys();
  return out;
}

}  // namespace

Design ReadDesign(const std::string& path, const std::vector<std::string>& overrides) {
  return ReadDesignFrom(LoadToml(path, overrides), path);
}

Design ParseDesign(const std::string& text, const std::string& name) {
  return ReadDesignFrom(ParseToml(text, name), name);
}

}  // namespace unfurl::data
