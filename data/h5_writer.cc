#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/error.h"
#include "data/h5_writer_impl.h"

namespace unfurl::data {

namespace {

// Names of files may be no UTF-8.
std::string Dump(const nlohmann::ordered_json& json) {
  return json.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
}

// The last net under cli/verb_files.h: a result never takes the place of what it was made from.
void RefuseInput(const Provenance& provenance, const std::string& path) {
  for (const InputFile& input : provenance.inputs) {
    std::error_code failed;
    if (!std::filesystem::equivalent(input.path, path, failed)) continue;
    throw Error("is an input of this result, and would be replaced by it", path,
                "name another output");
  }
}

}  // namespace

H5Writer::H5Writer(const std::string& path, const std::string& schema, int schema_version,
                   const Provenance& provenance, Mode mode)
    : impl_(
          (RefuseInput(provenance, path), std::make_unique<Impl>(path, mode == Mode::kStreamed))) {
  H5Quiet();
  H5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // The layout of 1.10: streaming needs it, and its indexes of chunks carry checksums.
  H5Pset_libver_bounds(access.get(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  H5Pset_fclose_degree(access.get(), H5F_CLOSE_STRONG);
  H5Handle creation(H5Pcreate(H5P_FILE_CREATE), H5Pclose);
  H5Pset_link_creation_order(creation.get(), H5P_CRT_ORDER_TRACKED | H5P_CRT_ORDER_INDEXED);
  H5Pset_obj_track_times(creation.get(), 0);
  impl_->handle = H5Handle(
      H5Fcreate(impl_->file.temporary().c_str(), H5F_ACC_TRUNC, creation.get(), access.get()),
      H5Fclose);
  if (!impl_->handle.valid()) impl_->Fail("the file");
  Attribute("/", "schema", schema);
  Attribute("/", "schema_version", static_cast<std::int64_t>(schema_version));
  Attribute("/", "program", provenance.program);
  Attribute("/", "command", provenance.command);
  nlohmann::ordered_json inputs = nlohmann::ordered_json::array();
  for (const InputFile& input : provenance.inputs) {
    inputs.push_back({{"path", input.path}, {"sha256", input.sha256}});
  }
  Attribute("/", "inputs", Dump(inputs));
  Attribute("/", "options", Dump(provenance.options));
  if (provenance.seed) Attribute("/", "seed", std::to_string(*provenance.seed));
}

H5Writer::~H5Writer() = default;

void H5Writer::Write(const H5Field& field, std::span<const double> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, std::span<const std::int32_t> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_STD_I32LE, H5T_NATIVE_INT32, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, std::span<const std::uint16_t> values,
                     std::vector<std::size_t> dims) {
  impl_->WriteAll(field, H5T_STD_U16LE, H5T_NATIVE_UINT16, values.data(), values.size(),
                  std::move(dims));
}

void H5Writer::Write(const H5Field& field, const Eigen::MatrixXd& matrix) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = matrix;
  Write(field, std::span<const double>(rows.data(), static_cast<std::size_t>(rows.size())),
        {static_cast<std::size_t>(rows.rows()), static_cast<std::size_t>(rows.cols())});
}

void H5Writer::Write(const H5Field& field, const std::vector<std::string>& values) {
  std::size_t width = 1;
  for (const std::string& value : values) width = std::max(width, value.size() + 1);
  std::string packed(width * std::max<std::size_t>(1, values.size()), '\0');
  for (std::size_t i = 0; i < values.size(); ++i) values[i].copy(packed.data() + i * width, width);
  const H5Handle type = H5Text(1);
  impl_->WriteAll(field, type.get(), type.get(), packed.data(), values.size() * width,
                  {values.size(), width});
  Attribute(field.path, kTextEncoding, std::string("utf-8"));
  impl_->texts[field.path] = width;
}

void H5Writer::Attribute(const std::string& object, const std::string& name,
                         const std::string& value) {
  impl_->PutText(impl_->Open(object).get(), name, value);
}

void H5Writer::Attribute(const std::string& object, const std::string& name, double value) {
  impl_->PutAttribute(impl_->Open(object).get(), name, H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE, &value);
}

void H5Writer::Attribute(const std::string& object, const std::string& name, std::int64_t value) {
  impl_->PutAttribute(impl_->Open(object).get(), name, H5T_STD_I64LE, H5T_NATIVE_INT64, &value);
}

void H5Writer::BareScale(const std::string& path, std::size_t size) {
  std::vector<std::int32_t> places(size);
  std::iota(places.begin(), places.end(), 0);
  Write({path, "1", "places"}, std::span<const std::int32_t>(places));
  impl_->bare.insert(path);
}

// Names the letters of every text: all dimensions have scales, or none.
void H5Writer::LabelLetters() {
  for (const auto& [path, width] : impl_->texts) {
    const std::string letters = fmt::format("/letters_{}", width);
    if (!impl_->bare.contains(letters)) BareScale(letters, width);
    impl_->letters_of[path] = letters;
  }
  for (H5Labelled& dataset : impl_->labelled) {
    if (impl_->texts.contains(dataset.path))
      dataset.scales.push_back(impl_->letters_of[dataset.path]);
  }
  impl_->texts.clear();
}

void H5Writer::AttachScales() {
  LabelLetters();
  if (!H5AttachScales(impl_->handle.get(), impl_->labelled, impl_->letters_of, impl_->bare))
    impl_->Fail("the scales");
  impl_->labelled.clear();
  impl_->letters_of.clear();
}

void H5Writer::StartStreaming() {
  if (!impl_->streamed) throw std::logic_error("H5Writer: made to be written whole");
  AttachScales();
  if (H5Fstart_swmr_write(impl_->handle.get()) < 0) impl_->Fail("the file");
}

void H5Writer::Overwrite(const std::string& dataset, std::span<const double> values) {
  const H5Handle set(H5Dopen2(impl_->handle.get(), dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.valid() ||
      H5Dwrite(set.get(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    impl_->Fail(dataset);
  }
}

void H5Writer::OverwriteText(const std::string& dataset, const std::string& value) {
  const H5Handle set(H5Dopen2(impl_->handle.get(), dataset.c_str(), H5P_DEFAULT), H5Dclose);
  if (!set.valid()) impl_->Fail(dataset);
  const H5Handle type(H5Dget_type(set.get()), H5Tclose);
  const H5Handle space(H5Dget_space(set.get()), H5Sclose);
  std::string padded = value;
  padded.resize(static_cast<std::size_t>(H5Sget_simple_extent_npoints(space.get())), '\0');
  if (H5Dwrite(set.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, padded.data()) < 0) {
    impl_->Fail(dataset);
  }
}

void H5Writer::Flush() {
  if (H5Fflush(impl_->handle.get(), H5F_SCOPE_GLOBAL) < 0) impl_->Fail("the file");
}

void H5Writer::CloseAll() {
  AttachScales();
  for (H5Handle& set : impl_->series) {
    if (!set.Close()) impl_->Fail("a dataset");
  }
  Flush();
  if (!impl_->handle.Close()) impl_->Fail("the file");
}

void H5Writer::Commit() {
  CloseAll();
  impl_->file.Commit();
}

void H5Writer::Keep() {
  impl_->file.Keep();  // first: what is on disk by now stays even where closing fails
  CloseAll();
}

void H5Writer::Abandon() {
  impl_->file.Keep();
  // Closing would write again what the disk has refused, and leave metadata that points past the
  // end of the file. As the last Flush left it, it can be read: so it is left open until the
  // program ends.
  static auto* left_open = new std::vector<H5Handle>;
  for (H5Handle& set : impl_->series) left_open->push_back(std::move(set));
  left_open->push_back(std::move(impl_->handle));
  impl_->series.clear();
}

void WriteAxisNames(H5Writer& file) {
  file.Write({kAxisNames, "1", "of a point"}, std::vector<std::string>{"x", "y", "z"});
}

void WriteComponentNames(H5Writer& file) {
  file.Write({kComponentNames, "1", "of a covariance"},
             std::vector<std::string>{"xx", "xy", "xz", "yy", "yz", "zz"});
}

const std::string& H5Writer::temporary() const { return impl_->file.temporary(); }

}  // namespace unfurl::data
