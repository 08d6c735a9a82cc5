#pragma once

#include <initializer_list>
#include <map>
#include <string>
#include <vector>

#include "data/scene.h"
#include "data/toml.h"

namespace unfurl::data {

// Throws Error at the first of `keys` that is given though it does nothing beside what else is, and
// says why.
void RefuseKeys(const TomlTable& table, std::initializer_list<const char*> keys,
                const std::string& why);

// Reads a scene's tables into its record. One file for what moves (scene_read_bodies.cc), one for
// what joins it (scene_read_joints.cc), one for what acts on it or watches it
// (scene_read_loads.cc).
class SceneReader {
 public:
  explicit SceneReader(const TomlTable& root) : root_(root) {}
  Scene Read(const std::string& path);

 private:
  // What a name stands for, for the quantities that events watch.
  enum class Thing { kBody, kBeam, kJoint, kMark, kSpring, kSensor };

  static void CheckName(const TomlTable& table, const std::string& name);
  // Bodies, beams, joints, springs and marks share the columns NAME.x, NAME.theta: one set of
  // names.
  void Register(const TomlTable& table, const std::string& name, Thing thing);

  void ReadBodies();
  void ReadBeams();
  static void ReadTaper(const TomlTable& table, SceneBeam* beam);
  static void ReadBendingStiffness(const TomlTable& table, SceneBeam* beam);
  static void ReadAxialStiffness(const TomlTable& table, SceneBeam* beam);
  void ReadWelds();

  void ReadContacts();
  void ReadJoints();
  static void ReadStart(const TomlTable& table, SceneJoint* joint);
  void ReadJointEffects(const TomlTable& table, SceneJoint* joint);
  void ReadDrive(const TomlTable& table, const TomlTable& owner, SceneJoint* joint);
  void ReadLatch(const TomlTable& table, SceneJoint* joint);

  void ReadLinearSprings();
  void ReadForces();
  void ReadWatches();
  void CheckQuantity(const TomlTable& table, const std::string& quantity) const;
  [[noreturn]] void FailUnwatchable(const TomlTable& table, const std::string& name,
                                    const std::string& column) const;
  std::vector<std::string> WatchedColumns(const std::string& name, Thing kind) const;
  void ReadMarks();
  void ReadSensors();
  static bool Unwatched(Thing thing);
  void ReadFields();
  void ReadSolver();

  // An end named by `key`, with its point, and its place along a beam where `at_key` allows one.
  SceneEnd ReadEnd(const TomlTable& table, const char* key, const char* point_key,
                   const char* at_key = nullptr) const;
  // A number, an expression of t, or a table; finite with its first `derivatives` throughout the
  // duration, as far as can be known.
  TimeFunction ReadFunction(const TomlTable& table, const char* key, int derivatives);

  TomlTable root_;
  Scene scene_;
  std::map<std::string, std::string> names_;  // name -> where it was taken
  std::map<std::string, Thing> things_;
  std::map<std::string, SceneEnd> ends_;
  std::map<std::string, int> beams_, contacts_;
  int functions_ = 0;  // expressions looked at so far
};

}  // namespace unfurl::data
