// docs/scene.md lists every key that the scene's readers ask for, and none besides.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "base/text.h"
#include "data/atomic_file.h"
#include "data/scene.h"
#include "data/toml.h"
#include "errors.h"
#include "scene_texts.h"
#include "tests/own_folder.h"
#include "tests/source_dir.h"

namespace unfurl::data::scene_page_test {
namespace {

using Keys = std::set<std::string>;

std::string Source(const std::string& path) {
  return ReadTextFile(std::string(UNFURL_SOURCE_DIR) + "/" + path);
}

struct Row {
  std::string table, key, unit, fallback;
};

// The rows of the table under "## Keys", one for each key.
std::vector<Row> PageRows() {
  std::istringstream page(Source("docs/scene.md"));
  std::vector<Row> rows;
  std::string line, table;
  bool inside = false;
  const std::regex word("`([^`]+)`");
  while (std::getline(page, line)) {
    if (line.starts_with("## ")) inside = line == "## Keys";
    if (!inside || !line.starts_with("|")) continue;
    const std::vector<std::string> cells = Split(line, '|');
    if (cells.size() < 7) ADD_FAILURE() << "not five cells: " << line;
    std::smatch match;
    if (std::regex_search(cells[1], match, word)) table = match[1];
    for (auto it = std::sregex_iterator(cells[2].begin(), cells[2].end(), word);
         it != std::sregex_iterator(); ++it) {
      rows.push_back({table, (*it)[1], std::string(Trim(cells[3])), std::string(Trim(cells[4]))});
    }
  }
  return rows;
}

Keys PageKeys() {
  Keys keys;
  for (const Row& row : PageRows()) keys.insert(row.table + " " + row.key);
  return keys;
}

// Scenes that between them take every branch of the readers.
const char* const kScenes[] = {
    "[scene]\nname = 's'\nduration = 1.0\n[body.bar]\nmass = 1\ninertia = 1\n"
    "[beam.rod]\nlength = 1\nmass = 1\nE = 1\nI = 1\narea = 1\n"
    "[beam.pole]\nlength = 1\nmass = 1\nE = 1\nI = 1\ndensity = 1\n"
    "[weld.w]\ninner = 'bar'\nouter = 'rod.start'\n"
    "[contact.c]\nradius_i = 1\nmodulus_i = 1\npoisson_i = 0.3\nmodulus_j = 1\npoisson_j = 0.3\n"
    "mass = 1\nlinear_stiffness = 1\nrestitution = 0.5\nQ = 1\nepsilon = 1\nradius_j = 1\n"
    "[joint.a]\ninner = 'ground'\nouter = 'bar'\n"
    "[joint.a.spring]\nstiffness = 1\nfree = 1\n"
    "[joint.a.quadratic_damper]\ndamping = 1\n"
    "[joint.a.damper]\ndamping = 1\n[joint.a.table]\ntheta = [0, 1]\nmoment = [0, 1]\n"
    "[joint.a.friction]\nmoment = 1\ncreep_rate = 1\n[joint.a.motor]\nmoment = 't'\n"
    "[joint.a.latch]\ntheta_a = 1\ntheta_b = 1\nlever = 1\ncontact = 'c'\n"
    "[joint.b]\ntype = 'slider'\ninner = 'ground'\nouter = 'bar'\n"
    "[joint.b.spring]\nstiffness = 1\n"
    "[joint.b.table]\ntravel = [0, 1]\nforce = [0, 1]\n"
    "[joint.b.friction]\nforce = 1\ncreep_rate = 1\n"
    "[joint.b.drive]\nposition = {t = [0, 2], value = [0, 1]}\n"
    "[joint.c]\ntype = 'pin_in_slot'\ninner = 'ground'\nouter = 'bar'\n"
    "[joint.c.drive]\nrate = 1\n"
    "[joint.d]\ntype = 'pin_in_slot'\ninner = 'ground'\nouter = 'bar'\n"
    "[joint.d.motor]\nforce = 1\n"
    "[spring.s]\na = 'bar'\nb = 'rod'\nb_at = 0.5\nstiffness = 1\nfree_length = 1\n"
    "[spring.u]\na = 'rod'\na_at = 0.5\nb = 'bar'\nstiffness = 1\n"
    "[force.f]\non = 'bar'\nforce = [0, 1]\n[force.m]\non = 'rod'\nat = 0.5\ntorque = 1\n"
    "[force.q]\non = 'rod'\nper_length = [0, 1]\n"
    "[event.e]\nwhen = 'a.theta'\n[gravity]\nacceleration = [0, 1]\n[suspension]\nlength = 1\n"
    "[mark.m]\non = 'bar'\n[mark.n]\non = 'rod'\nat = 0.5\n"
    "[sensor.g]\nkind = 'strain_gauge'\non = 'rod'\nat = 0.5\nheight = 0.01\n"
    "[sensor.x]\nkind = 'accelerometer'\non = 'bar'\npoint = [0, 1]\naxis = 1\n"
    "[solver]\nmethod = 'auto'\nrtol = 1e-6\nrate = 10\n",
    "[scene]\nname = 's'\nduration = 1.0\n[beam.rod]\nlength = 1\nmass = 1\nEI = 1\nEA = 1\n"
    "[contact.c]\nK = 1\nC = 1\nQ = 1\nepsilon = 1\n"
    "[contact.h]\nK = 1\nlaw = 'hunt_crossley'\nalpha = 0.1\n",
};

// "joint.b.drive.position.t" as "F t", "body.bar.mass" as "body.NAME mass"; nothing for tables.
std::string InPageTerms(const std::string& asked, const Keys& tables) {
  std::vector<std::string> parts = Split(asked, '.');
  static const Keys kNamed = {"body",   "beam",  "weld",  "contact", "joint",
                              "spring", "force", "event", "mark", "sensor"};
  if (kNamed.contains(parts[0])) {
    if (parts.size() < 3) return "";
    parts[1] = "NAME";
  }
  const std::string key = parts.back();
  if (std::isdigit(static_cast<unsigned char>(key[0]))) return "";  // an item of an array
  parts.pop_back();
  std::string table;
  for (const std::string& part : parts) table += (table.empty() ? "" : ".") + part;
  if (tables.contains(table.empty() ? key : table + "." + key)) return "";
  if (table.empty()) table = "(top)";
  return (tables.contains(table) ? table : "F") + " " + key;
}

TEST(ScenePage, ListsEveryKeyAndNoOther) {
  const Keys page = PageKeys();
  Keys tables{"(top)"};
  for (const Row& row : PageRows()) tables.insert(row.table);
  Keys asked;
  const OwnFolder folder;
  const std::string path = folder.File("scene.toml");
  for (const char* text : kScenes) {
    WriteTextFile(path, text);
    const TomlTable root = LoadToml(path);
    ReadScene(root, "s.toml");
    for (const std::string& key : root.Asked()) {
      const std::string term = InPageTerms(key, tables);
      if (!term.empty()) asked.insert(term);
    }
  }
  for (const std::string& key : asked)
    EXPECT_TRUE(page.contains(key)) << "not on the page: " << key;
  for (const std::string& key : page) EXPECT_TRUE(asked.contains(key)) << "not read: " << key;
  // The scenes above miss no branch: each key that stands in the readers' text was asked for.
  const std::regex call(
      R"re((?:Number|Integer|Bool|String|Choice|Numbers|Strings|Items|Has|NumberOr|IntegerOr|BoolOr|StringOr|ChoiceOr|TableOrNone|TripleOrNone|ReadFunction|ReadEnd)\((?:\*?table, |\*?items, )?"([A-Za-z_]+)")re");
  Keys words;
  for (const std::string& key : asked) words.insert(Split(key, ' ')[1]);
  for (const std::string& table : tables) {
    for (const std::string& part : Split(table, '.')) words.insert(part);
  }
  int calls = 0;
  for (const char* file : {"data/scene_reader.cc", "data/scene_read_bodies.cc",
                           "data/scene_read_joints.cc", "data/scene_read_loads.cc"}) {
    const std::string text = Source(file);
    for (auto it = std::sregex_iterator(text.begin(), text.end(), call);
         it != std::sregex_iterator(); ++it, ++calls) {
      EXPECT_TRUE(words.contains((*it)[1]))
          << file << " reads a key that no scene here takes: " << (*it)[1];
    }
  }
  EXPECT_GT(calls, 60);
}

TEST(ScenePage, SaysUnitAndDefaultOfEachKey) {
  for (const Row& row : PageRows()) {
    EXPECT_NE(row.unit, "") << row.table << " " << row.key;
    EXPECT_NE(row.fallback, "") << row.table << " " << row.key;
  }
}

// A reader that asks for a key that the page has not is seen: so the test can fail.
TEST(ScenePage, WouldMissAKey) {
  const Keys page = PageKeys();
  EXPECT_TRUE(page.contains("joint.NAME.friction creep_rate"));
  EXPECT_FALSE(page.contains("joint.NAME.friction stiction"));
  EXPECT_EQ(InPageTerms("joint.a.friction.stiction", {"joint.NAME.friction"}),
            "joint.NAME.friction stiction");
}

}  // namespace
}  // namespace unfurl::data::scene_page_test
