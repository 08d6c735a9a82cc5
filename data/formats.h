#pragma once

#include <string>
#include <variant>
#include <vector>

#include "data/csv.h"
#include "data/fit.h"
#include "data/lab.h"
#include "data/rig.h"
#include "data/run.h"
#include "data/scene.h"
#include "data/study.h"
#include "data/survey.h"
#include "data/tracks.h"

namespace unfurl::data {

/// The forms that files take. One list, for every verb and library.
enum class FileFormat {
  kHdf5,     ///< .h5, .hdf5: machines' records; the schema inside says which
  kCsv,      ///< .csv
  kC3d,      ///< .c3d: tracks
  kUff,      ///< .uff, .unv, .uf: tracks, universal file 58
  kToml,     ///< .toml: scenes, laboratories, studies, descriptions of raw lines
  kUnknown,  ///< any other ending
};

/// Of a name, with its dot and in small letters; empty: it has none.
std::string EndingOf(const std::string& path);

/// By the ending, in any case ("TRACKS.CSV").
FileFormat FormatOf(const std::string& path);

/// "tracks.h5, tracks.csv, ..": the endings of the formats that hold tracks, for messages.
std::string TracksEndings();

/// Whether tracks can be in this form.
bool HoldsTracks(FileFormat format);

/// Tracks in any of their forms. `sigma` [m] is that of one axis where the file tells none (.c3d,
/// .uff); 0: such a file is refused. Throws Error for a file that holds no tracks.
Tracks ReadTracksAny(const std::string& path, double sigma = 0.0);

/// Tracks to any of their forms, by the ending. Throws Error for an ending that is none of theirs.
void WriteTracksAny(const std::string& path, const Tracks& tracks, const Provenance& provenance);

/// The schema of a file as convert and info name it: that inside an HDF5 file, tracks and surveys
/// of other forms; "scene", "lab", "study" of TOML. Throws Error for a file of none of them.
std::string KindOf(const std::string& path);

/// Any file that holds one record, whole in memory. A trial (raw lines, gigabytes) is read in
/// blocks by TrialReader and refused here, as is a description of raw lines.
using AnyRecord = std::variant<Run, Tracks, Rig, Survey, FitRecord, Scene, Lab, Study>;
AnyRecord Load(const std::string& path);

}  // namespace unfurl::data
