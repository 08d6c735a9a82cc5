#include "study/cost_meshes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "sim/methods/simulate.h"

namespace unfurl::study {
namespace {

using Beam = CostMesh::Beam;
using data::BeamModel;

constexpr int kRungs = 3;       // from which the order of convergence follows
constexpr int kMoreShapes = 2;  // from rung to rung: errors of odd and even orders differ
constexpr int kPlainOrders =
    4;  // tried where nothing is asked: beyond, segments' steps are as long

void Describe(const data::Scene& scene, CostMesh* mesh) {
  int least = 0, most = 0;
  bool smooth = false;
  for (const Beam& beam : mesh->beams) {
    least = least == 0 ? beam.size : std::min(least, beam.size);
    most = std::max(most, beam.size);
    smooth = beam.model == BeamModel::kKirchhoff;
  }
  if (most == 0) return;
  const std::string sizes =
      least == most ? fmt::format("{}", most) : fmt::format("{} to {}", least, most);
  mesh->words = smooth ? "smooth, order " + sizes : sizes + (most == 1 ? " segment" : " segments");
  if (least == most) (smooth ? mesh->order : mesh->segments) = most;
  for (std::size_t b = 0; b < mesh->beams.size(); ++b) {
    const data::SceneBeam& own = scene.beams[b];
    const Beam& beam = mesh->beams[b];
    const std::string key = "beam." + own.name + ".";
    if (beam.model != own.model) {
      mesh->set.push_back(key + (smooth ? "model=kirchhoff" : "model=segments"));
    }
    if (beam.size != (smooth ? own.order : own.segments)) {
      mesh->set.push_back(key + (smooth ? "order=" : "segments=") + std::to_string(beam.size));
    }
  }
}

// `size` by beam of the scene.
template <typename Size>
CostMesh Mesh(const data::Scene& scene, BeamModel model, const Size& size) {
  CostMesh mesh;
  for (const data::SceneBeam& beam : scene.beams) mesh.beams.push_back({model, size(beam)});
  Describe(scene, &mesh);
  return mesh;
}

CostMesh Uniform(const data::Scene& scene, BeamModel model, int size) {
  return Mesh(scene, model, [&](const data::SceneBeam&) { return size; });
}

// Why the scene cannot have smooth beams; empty: it can.
std::string WhyNotSmooth(const data::Scene& scene) {
  for (const data::SceneBeam& beam : scene.beams) {
    if (!beam.gradient_form) {
      return fmt::format("beam '{}' has the printed form, which is of segments", beam.name);
    }
  }
  try {
    sim::CompileModel(Uniform(scene, BeamModel::kKirchhoff, 1).Of(scene));
  } catch (const Error& e) {
    return e.problem();
  }
  return {};
}

void CheckSizes(const std::vector<int>& sizes, int most, const char* option, const char* what) {
  for (const int n : sizes) {
    if (n < 1 || n > most) {
      throw Error(fmt::format("{} {}", n, what), option, fmt::format("use 1 to {}", most));
    }
  }
}

// Half, once and twice the scene's own segments: of a smooth beam what its key stands for.
void AddPlainSegments(const data::Scene& scene, std::vector<CostMesh>* out) {
  std::set<std::string> known;
  for (const double factor : {0.5, 1.0, 2.0}) {
    CostMesh mesh = Mesh(scene, BeamModel::kSegments, [&](const data::SceneBeam& beam) {
      return std::max(1, static_cast<int>(std::lround(factor * beam.segments)));
    });
    if (known.insert(mesh.words).second) out->push_back(std::move(mesh));
  }
}

std::vector<int> PlainOrders(const data::Scene& scene) {
  std::set<int> orders;
  for (int p = 1; p <= kPlainOrders; ++p) orders.insert(p);
  for (const data::SceneBeam& beam : scene.beams) {
    if (beam.model == BeamModel::kKirchhoff) orders.insert(beam.order);
  }
  return {orders.begin(), orders.end()};
}

// The last rung is as fine as the finest that is asked, or finer.
std::vector<CostMesh> SegmentRungs(const data::Scene& scene, const std::vector<CostMesh>& asked) {
  std::vector<int> first(scene.beams.size(), 1);
  for (const CostMesh& mesh : asked) {
    for (std::size_t b = 0; b < mesh.beams.size(); ++b) {
      if (mesh.beams[b].model == BeamModel::kSegments) {
        first[b] = std::max(first[b], (mesh.beams[b].size + 3) / 4);
      }
    }
  }
  // One segment has no order of convergence yet: a free one cannot bend.
  constexpr int kFewest = 2;
  CostMesh mesh;
  for (const int n : first) mesh.beams.push_back({BeamModel::kSegments, std::max(kFewest, n)});
  Describe(scene, &mesh);
  std::vector<CostMesh> rungs = {mesh};
  while (static_cast<int>(rungs.size()) < kRungs) rungs.push_back(FinerMesh(scene, rungs.back()));
  return rungs;
}

std::vector<CostMesh> SmoothRungs(const data::Scene& scene, const std::vector<CostMesh>& asked) {
  int finest = kPlainOrders;
  for (const CostMesh& mesh : asked) finest = std::max(finest, mesh.order);
  const int last = std::min(data::kHighestOrder, finest + kMoreShapes * (kRungs - 1));
  std::vector<CostMesh> rungs;
  for (int k = kRungs - 1; k >= 0; --k) {
    rungs.push_back(Uniform(scene, BeamModel::kKirchhoff, last - k * kMoreShapes));
  }
  return rungs;
}

}  // namespace

data::Scene CostMesh::Of(data::Scene scene) const {
  for (std::size_t b = 0; b < beams.size(); ++b) {
    data::SceneBeam& beam = scene.beams[b];
    beam.model = beams[b].model;
    (beam.model == BeamModel::kSegments ? beam.segments : beam.order) = beams[b].size;
  }
  return scene;
}

bool HasFinerMesh(const CostMesh& mesh) {
  return std::all_of(mesh.beams.begin(), mesh.beams.end(), [](const Beam& b) {
    return b.model == BeamModel::kSegments ? b.size <= data::kMostSegments / 2
                                           : b.size + kMoreShapes <= data::kHighestOrder;
  });
}

CostMesh FinerMesh(const data::Scene& scene, const CostMesh& mesh) {
  CostMesh finer;
  for (Beam beam : mesh.beams) {
    beam.size = beam.model == BeamModel::kSegments ? 2 * beam.size : beam.size + kMoreShapes;
    finer.beams.push_back(beam);
  }
  Describe(scene, &finer);
  return finer;
}

CostMeshes MeshesOf(const data::Scene& scene, const std::vector<int>& segments,
                    const std::vector<int>& orders) {
  CheckSizes(segments, data::kMostSegments, "option segments", "segments");
  CheckSizes(orders, data::kHighestOrder, "option order", "is no order");
  CostMeshes out;
  if (scene.beams.empty()) {
    if (!segments.empty() || !orders.empty()) {
      throw Error("the scene has no beam", scene.path, "leave --segments and --order out");
    }
    out.asked.emplace_back();
    return out;
  }
  out.no_smooth = WhyNotSmooth(scene);
  if (!orders.empty() && !out.no_smooth.empty()) {
    throw Error(out.no_smooth, scene.path, "leave --order out");
  }
  for (const int n : segments) out.asked.push_back(Uniform(scene, BeamModel::kSegments, n));
  const bool plain = segments.empty() && orders.empty();
  if (plain) AddPlainSegments(scene, &out.asked);
  if (out.no_smooth.empty()) {
    for (const int p : plain ? PlainOrders(scene) : orders) {
      out.asked.push_back(Uniform(scene, BeamModel::kKirchhoff, p));
    }
    out.smooth = SmoothRungs(scene, out.asked);
  }
  out.segments = SegmentRungs(scene, out.asked);
  return out;
}

}  // namespace unfurl::study
