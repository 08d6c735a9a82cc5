#include "data/rig.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cstdint>
#include <optional>

#include "base/error.h"
#include "data/h5.h"

namespace unfurl::data {
namespace {

constexpr double kOrthonormal = 1e-9;   // of R_CW, beyond the round-off of a file of doubles
constexpr double kSemidefinite = 1e-9;  // of the scaled covariance's eigenvalues

// "held_out_rms [m]" is the dataset /checks/held_out_rms with units m.
std::pair<std::string, std::string> SplitCheck(const std::string& check) {
  const std::size_t open = check.rfind(" [");
  if (open == std::string::npos || check.back() != ']') return {check, "1"};
  return {check.substr(0, open), check.substr(open + 2, check.size() - open - 3)};
}

double ReadNumber(const H5Reader& file, const std::string& path, const std::string& units) {
  const std::vector<double> values = file.ReadDoubles(path, units);
  if (values.size() != 1 || !std::isfinite(values[0])) {
    file.Fail("is not one finite number", path, "calibrate again");
  }
  return values[0];
}

Eigen::MatrixXd ReadFinite(const H5Reader& file, const std::string& path, const std::string& units,
                           Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd matrix = file.ReadMatrix(path, units);
  if (matrix.rows() != rows || matrix.cols() != cols) {
    file.Fail(fmt::format("is {} x {} where {} x {} is expected", matrix.rows(), matrix.cols(),
                          rows, cols),
              path, "calibrate again");
  }
  if (!matrix.allFinite()) file.Fail("holds a number that is not finite", path, "calibrate again");
  return matrix;
}

void CheckCovariance(const H5Reader& file, const Eigen::MatrixXd& covariance) {
  const Eigen::VectorXd scale =
      covariance.diagonal().unaryExpr([](double v) { return v > 0.0 ? 1.0 / std::sqrt(v) : 0.0; });
  const Eigen::MatrixXd scaled = scale.asDiagonal() * covariance * scale.asDiagonal();
  const double skew = (scaled - scaled.transpose()).cwiseAbs().maxCoeff();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(scaled, Eigen::EigenvaluesOnly);
  if (covariance.diagonal().minCoeff() < 0.0 || skew > kSemidefinite ||
      eigen.eigenvalues()(0) < -kSemidefinite * static_cast<double>(covariance.rows())) {
    file.Fail("is not symmetric and positive semidefinite", "/covariance", "calibrate again");
  }
}

constexpr char kCameraNames[] = "/cameras/name";

// The cameras' lens models; their terms, of which older files have fewer, must be those that this
// version knows by these names.
std::vector<LensModel> ReadLenses(const H5Reader& file, const std::vector<std::string>& cameras,
                                  std::size_t* count) {
  const std::vector<std::string> names = file.ReadStrings("/cameras/lens");
  const std::vector<std::string> terms = file.ReadStrings("/cameras/term_names");
  *count = terms.size() / cameras.size();
  if (names.size() != cameras.size() || terms.size() != cameras.size() * *count ||
      *count > kLensTerms) {
    file.Fail("does not hold one lens for each camera", "/cameras/lens", "calibrate again");
  }
  std::vector<LensModel> out;
  for (std::size_t j = 0; j < names.size(); ++j) {
    const std::optional<LensModel> model = FindLensModel(names[j]);
    if (!model) {
      file.Fail(fmt::format("camera \"{}\" has the lens model \"{}\", which this version lacks",
                            cameras[j], names[j]),
                "/cameras/lens", "use the version that wrote it, or calibrate again");
    }
    const auto& known = NamesOf(*model).terms;
    const auto first = terms.begin() + static_cast<std::ptrdiff_t>(j * *count);
    if (!std::equal(first, first + static_cast<std::ptrdiff_t>(*count), known.begin(),
                    [](const std::string& has, const char* knows) {
                      return has.empty() || has == knows;
                    })) {
      file.Fail("lists other terms than this version knows", "/cameras/term_names",
                "calibrate again");
    }
    out.push_back(*model);
  }
  return out;
}

}  // namespace

void WriteRig(const std::string& path, const Rig& rig, const Provenance& provenance) {
  const auto c = static_cast<Eigen::Index>(rig.cameras.size());
  std::vector<std::string> names, lenses, terms;
  std::vector<std::int32_t> pixels;
  Eigen::MatrixXd R_CW(c, 9), p_WC(c, 3), values(c, static_cast<Eigen::Index>(kLensTerms));
  std::vector<double> f, u0, e;
  for (Eigen::Index j = 0; j < c; ++j) {
    const RigCamera& camera = rig.cameras[static_cast<std::size_t>(j)];
    names.push_back(camera.name);
    pixels.push_back(camera.pixels);
    const LensNames& lens = NamesOf(camera.lens);
    lenses.emplace_back(lens.name);
    terms.insert(terms.end(), lens.terms.begin(), lens.terms.end());
    for (Eigen::Index k = 0; k < 9; ++k) R_CW(j, k) = camera.R_CW(k / 3, k % 3);
    p_WC.row(j) = camera.p_WC.transpose();
    for (Eigen::Index k = 0; k < values.cols(); ++k) {
      values(j, k) = camera.terms_px[static_cast<std::size_t>(k)];
    }
    f.push_back(camera.f_px);
    u0.push_back(camera.u0_px);
    e.push_back(camera.e);
  }

  H5Writer file(path, kRigSchema, kRigVersion, provenance);
  WriteAxisNames(file);
  file.Write({kCameraNames, "1", "cameras' names"}, names);
  file.Write({"/cameras/pixels",
              "1",
              "active pixels; readings lie from 0 to this less one",
              {kCameraNames}},
             pixels);
  file.Write({"/cameras/lens", "1", "lens models' names", {kCameraNames}}, lenses);
  file.Write({"/cameras/R_CW", "1", "rotation from world to camera, camera x 9, row by row"}, R_CW);
  file.Write({"/cameras/p_WC", "m", "the slit's centre in the world", {kCameraNames, kAxisNames}},
             p_WC);
  file.Write({"/cameras/f", "px", "image scale", {kCameraNames}}, f);
  file.Write({"/cameras/u0", "px", "reading on the optical axis", {kCameraNames}}, u0);
  file.Write({"/cameras/e", "m", "distance between the two centres", {kCameraNames}}, e);
  file.Write({"/cameras/terms", "px", "coefficients of the terms, camera x 22"}, values);
  file.Write({"/cameras/term_names", "1",
              "what each coefficient multiplies, camera by camera; x = X/Z, y = Y/(Z+e), "
              "a = atan(x); empty: none"},
             terms);
  // Labelled, lest netCDF4 take the letters of a reason of that length for its dimension.
  const auto parameters = static_cast<std::size_t>(rig.covariance.rows());
  const std::vector<std::string> scales = {"/parameter", "/parameter_2"};
  for (const std::string& name : scales) file.BareScale(name, parameters);
  file.Write({"/covariance", "rad, m, px",
              "joint covariance of all cameras' parameters: 31 each, rotation, p_WC, f, u0, e, "
              "terms",
              scales},
             rig.covariance);
  file.Write({"/model_floor", "px", "the largest of the cameras' floors"},
             std::vector<double>{rig.model_floor_px});
  std::vector<double> floors;
  for (std::size_t j = 0; j < rig.cameras.size(); ++j) floors.push_back(FloorOf(rig, j));
  file.Write(
      {"/cameras/floor", "px", "added in quadrature to each reading's sigma", {kCameraNames}},
      floors);
  const auto corner = [](const Eigen::Vector3d& p) {
    return std::vector<double>{p.x(), p.y(), p.z()};
  };
  file.Write({"/volume_low", "m", "least corner of the surveyed box", {kAxisNames}},
             corner(rig.volume_low));
  file.Write({"/volume_high", "m", "greatest corner of the surveyed box", {kAxisNames}},
             corner(rig.volume_high));
  for (const auto& [check, value] : rig.checks) {
    const auto [name, units] = SplitCheck(check);
    file.Write({"/checks/" + name, units, check}, std::vector<double>{value});
  }
  file.Write({"/reasons", "1", "why the verdict is what it is"}, rig.reasons);
  file.Attribute("/", "verdict", rig.verdict);
  file.Commit();
}

namespace {

// One finite number per camera.
std::vector<double> ReadColumn(const H5Reader& file, std::size_t cameras, const char* dataset,
                               const char* units) {
  std::vector<double> out = file.ReadDoubles(dataset, units);
  if (out.size() != cameras ||
      !std::all_of(out.begin(), out.end(), [](double v) { return std::isfinite(v); })) {
    file.Fail("does not hold one finite number per camera", dataset, "calibrate again");
  }
  return out;
}

void ReadCameras(const H5Reader& file, const std::vector<std::string>& names,
                 const std::vector<LensModel>& lenses, const std::vector<std::int32_t>& pixels,
                 std::size_t terms, Rig* rig) {
  const auto c = static_cast<Eigen::Index>(names.size());
  const Eigen::MatrixXd R_CW = ReadFinite(file, "/cameras/R_CW", "1", c, 9);
  const Eigen::MatrixXd p_WC = ReadFinite(file, "/cameras/p_WC", "m", c, 3);
  const Eigen::MatrixXd values =
      ReadFinite(file, "/cameras/terms", "px", c, static_cast<Eigen::Index>(terms));
  const std::vector<double> f = ReadColumn(file, names.size(), "/cameras/f", "px"),
                            u0 = ReadColumn(file, names.size(), "/cameras/u0", "px"),
                            e = ReadColumn(file, names.size(), "/cameras/e", "m");
  for (Eigen::Index j = 0; j < c; ++j) {
    const auto index = static_cast<std::size_t>(j);
    RigCamera camera;
    camera.name = names[index];
    camera.pixels = pixels[index];
    camera.lens = lenses[index];
    for (Eigen::Index k = 0; k < 9; ++k) camera.R_CW(k / 3, k % 3) = R_CW(j, k);
    const Eigen::Matrix3d unity = camera.R_CW * camera.R_CW.transpose();
    if (!unity.isIdentity(kOrthonormal) || camera.R_CW.determinant() < 0.0) {
      file.Fail(fmt::format("camera \"{}\" has no proper rotation", camera.name), "/cameras/R_CW",
                "calibrate again");
    }
    camera.p_WC = p_WC.row(j).transpose();
    for (Eigen::Index k = 0; k < values.cols(); ++k) {
      camera.terms_px[static_cast<std::size_t>(k)] = values(j, k);
    }
    camera.f_px = f[index];
    camera.u0_px = u0[index];
    camera.e = e[index];
    rig->cameras.push_back(camera);
  }
}

// Of `c` cameras with so many terms; those that an older file lacks are known to be zero.
Eigen::MatrixXd ReadCovariance(const H5Reader& file, Eigen::Index c, std::size_t terms) {
  const Eigen::Index own = kFirstTerm + static_cast<Eigen::Index>(terms);
  const Eigen::MatrixXd stored = ReadFinite(file, "/covariance", "rad, m, px", own * c, own * c);
  Eigen::MatrixXd out = Eigen::MatrixXd::Zero(kCameraParameters * c, kCameraParameters * c);
  for (Eigen::Index a = 0; a < c; ++a) {
    for (Eigen::Index b = 0; b < c; ++b) {
      out.block(kCameraParameters * a, kCameraParameters * b, own, own) =
          stored.block(own * a, own * b, own, own);
    }
  }
  return out;
}

}  // namespace

Rig ReadRig(const std::string& path) {
  const H5Reader file(path, kRigSchema, kRigVersion);
  Rig rig;
  const std::vector<std::string> names = file.ReadStrings("/cameras/name");
  if (names.empty()) file.Fail("names no camera", "/cameras/name", "calibrate again");
  if (file.schema_version() < 2) {
    file.Fail("does not say how many pixels each camera has: it was written by an older version",
              "/cameras/pixels", "calibrate again");
  }
  std::size_t terms = 0;
  const std::vector<LensModel> lenses = ReadLenses(file, names, &terms);
  const std::vector<std::int32_t> pixels = file.ReadInts("/cameras/pixels");
  if (pixels.size() != names.size() || *std::min_element(pixels.begin(), pixels.end()) < 1) {
    file.Fail("does not hold a number of pixels for each camera", "/cameras/pixels",
              "calibrate again");
  }
  ReadCameras(file, names, lenses, pixels, terms, &rig);
  const auto c = static_cast<Eigen::Index>(names.size());
  rig.covariance = ReadCovariance(file, c, terms);
  CheckCovariance(file, rig.covariance);
  rig.model_floor_px = ReadNumber(file, "/model_floor", "px");
  if (rig.model_floor_px < 0.0) file.Fail("is negative", "/model_floor", "calibrate again");
  if (file.Has("/cameras/floor")) {  // older files have one floor for all
    const std::vector<double> floors = ReadColumn(file, names.size(), "/cameras/floor", "px");
    for (std::size_t j = 0; j < floors.size(); ++j) {
      if (floors[j] < 0.0) file.Fail("is negative", "/cameras/floor", "calibrate again");
      rig.cameras[j].floor_px = floors[j];
    }
  }
  const auto corner = [&](const char* dataset) {
    const std::vector<double> p = file.ReadDoubles(dataset, "m");
    if (p.size() != 3) file.Fail("is not three numbers", dataset, "calibrate again");
    return Eigen::Vector3d(p[0], p[1], p[2]);
  };
  rig.volume_low = corner("/volume_low");
  rig.volume_high = corner("/volume_high");
  if (!((rig.volume_high - rig.volume_low).minCoeff() > 0.0)) {
    file.Fail("does not lie above volume_low", "/volume_high", "calibrate again");
  }
  if (file.Has("/checks")) {
    for (const std::string& name : file.Children("/checks")) {
      const std::string dataset = "/checks/" + name;
      const std::string units = file.Units(dataset);
      rig.checks[fmt::format("{} [{}]", name, units)] = ReadNumber(file, dataset, units);
    }
  }
  rig.reasons = file.ReadStrings("/reasons");
  rig.verdict = file.StringAttribute("/", "verdict");
  return rig;
}

}  // namespace unfurl::data
