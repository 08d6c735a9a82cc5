#include "data/h5_packed.h"

#include <libdeflate.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>

#include "base/worker_pool.h"

namespace unfurl::data {

namespace {

constexpr std::size_t kMostKept = std::size_t{64}
                                  << 20;  // of memory, for rows not asked for [byte]
constexpr std::size_t kMostPacked = std::size_t{8}
                                    << 20;  // fetched before they are unpacked [byte]
constexpr std::size_t kChecksum = 4;        // what Fletcher's takes [byte]

// Each element's first bytes, then each one's second ones, and so on, back into elements.
void Unshuffle(const std::uint8_t* in, std::size_t size, std::size_t element, std::uint8_t* out) {
  const std::size_t count = size / element;
  if (element == 2) {  // sensor lines
    for (std::size_t i = 0; i < count; ++i) {
      out[2 * i] = in[i];
      out[2 * i + 1] = in[count + i];
    }
  } else {
    for (std::size_t b = 0; b < element; ++b) {
      for (std::size_t i = 0; i < count; ++i) out[i * element + b] = in[b * count + i];
    }
  }
  std::memcpy(out + count * element, in + count * element, size - count * element);
}

void Shuffle(const std::uint8_t* in, std::size_t size, std::size_t element, std::uint8_t* out) {
  const std::size_t count = size / element;
  for (std::size_t b = 0; b < element; ++b) {
    for (std::size_t i = 0; i < count; ++i) out[b * count + i] = in[i * element + b];
  }
  std::memcpy(out + count * element, in + count * element, size - count * element);
}

std::vector<int> FiltersOf(hid_t made) {
  std::vector<int> out;
  const int filters = H5Pget_nfilters(made);
  for (int f = 0; f < filters; ++f) {
    unsigned flags = 0;
    std::size_t values = 0;
    out.push_back(H5Pget_filter2(made, static_cast<unsigned>(f), &flags, &values, nullptr, 0,
                                 nullptr, nullptr));
  }
  return out;
}

std::uint32_t LittleEndian(const std::uint8_t* p) {
  return static_cast<std::uint32_t>(p[0]) | static_cast<std::uint32_t>(p[1]) << 8U |
         static_cast<std::uint32_t>(p[2]) << 16U | static_cast<std::uint32_t>(p[3]) << 24U;
}

using Inflater = std::unique_ptr<libdeflate_decompressor, decltype(&libdeflate_free_decompressor)>;

// Undoes one filter; `most` is what may come out. False: damaged, or more than that.
bool Undo(int filter, std::size_t element, std::size_t most, std::vector<std::uint8_t>* bytes,
          std::vector<std::uint8_t>* spare) {
  if (filter == H5Z_FILTER_FLETCHER32) {
    if (bytes->size() < kChecksum) return false;
    const std::size_t size = bytes->size() - kChecksum;
    if (H5Fletcher32(bytes->data(), size) != LittleEndian(bytes->data() + size)) return false;
    bytes->resize(size);
    return true;
  }
  if (filter == H5Z_FILTER_SHUFFLE) {
    spare->resize(bytes->size());
    Unshuffle(bytes->data(), bytes->size(), element, spare->data());
  } else {
    thread_local const Inflater inflater(libdeflate_alloc_decompressor(),
                                         &libdeflate_free_decompressor);
    std::size_t size = 0;
    spare->resize(most);
    if (inflater == nullptr ||
        libdeflate_zlib_decompress(inflater.get(), bytes->data(), bytes->size(), spare->data(),
                                   most, &size) != LIBDEFLATE_SUCCESS) {
      return false;
    }
    spare->resize(size);
  }
  bytes->swap(*spare);
  return true;
}

}  // namespace

std::uint32_t H5Fletcher32(const std::uint8_t* data, std::size_t size) {
  // Sums of words, and of these sums, modulo 65535, where 0 stays 0 only if all was 0.
  constexpr std::size_t kWords = 4096;  // their sums of sums stay below 2^63 [-]
  std::uint64_t sum = 0, sums = 0;
  const auto fold = [](std::uint64_t value) {
    while (value > 0xffffU) value = (value & 0xffffU) + (value >> 16U);
    return value;
  };
  const auto word = [&](std::size_t i) {
    return static_cast<std::uint32_t>(data[2 * i]) << 8U | data[2 * i + 1];
  };
  const std::size_t words = size / 2;
  for (std::size_t first = 0; first < words; first += kWords) {
    const std::size_t n = std::min(kWords, words - first);
    std::uint64_t plain = 0, weighted = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint32_t value = word(first + i);
      plain += value;
      weighted += value * static_cast<std::uint32_t>(n - i);
    }
    sums = fold(sums + n * sum + weighted);
    sum = fold(sum + plain);
  }
  if (size % 2 != 0) {
    sum = fold(sum + (static_cast<std::uint64_t>(data[size - 1]) << 8U));
    sums = fold(sums + sum);
  }
  return static_cast<std::uint32_t>(sums << 16U | sum);
}

namespace {

using Deflater = std::unique_ptr<libdeflate_compressor, decltype(&libdeflate_free_compressor)>;

// Shuffled, deflated, with its checksum; empty: no memory.
std::vector<std::uint8_t> Pack(const std::uint8_t* in, std::size_t size, std::size_t element,
                               int level) {
  thread_local std::vector<std::uint8_t> shuffled, room;
  thread_local int made_for = 0;
  thread_local Deflater deflater(nullptr, &libdeflate_free_compressor);
  if (deflater == nullptr || made_for != level) {
    deflater.reset(libdeflate_alloc_compressor(level));
    made_for = level;
  }
  if (deflater == nullptr) return {};
  shuffled.resize(size);
  Shuffle(in, size, element, shuffled.data());
  room.resize(libdeflate_zlib_compress_bound(deflater.get(), size));
  const std::size_t packed =
      libdeflate_zlib_compress(deflater.get(), shuffled.data(), size, room.data(), room.size());
  if (packed == 0) return {};
  std::vector<std::uint8_t> out(packed + kChecksum);
  std::memcpy(out.data(), room.data(), packed);
  const std::uint32_t sum = H5Fletcher32(out.data(), packed);
  for (std::size_t b = 0; b < kChecksum; ++b) {
    out[packed + b] = static_cast<std::uint8_t>(sum >> (8 * b));
  }
  return out;
}

}  // namespace

H5Packed::H5Packed(H5Handle dataset, hid_t memory_type) : dataset_(std::move(dataset)) {
  const H5Handle type(H5Dget_type(dataset_.get()), H5Tclose);
  const H5Handle space(H5Dget_space(dataset_.get()), H5Sclose);
  const H5Handle made(H5Dget_create_plist(dataset_.get()), H5Pclose);
  const int rank = H5Sget_simple_extent_ndims(space.get());
  if (!type.valid() || !made.valid() || rank < 1 || H5Pget_layout(made.get()) != H5D_CHUNKED ||
      H5Tequal(type.get(), memory_type) <= 0) {
    return;
  }
  extent_.resize(static_cast<std::size_t>(rank));
  chunk_.resize(extent_.size());
  H5Sget_simple_extent_dims(space.get(), extent_.data(), nullptr);
  if (H5Pget_chunk(made.get(), rank, chunk_.data()) != rank) return;
  element_ = chunk_bytes_ = row_bytes_ = H5Tget_size(type.get());
  for (const hsize_t n : chunk_) chunk_bytes_ *= n;
  for (std::size_t d = 1; d < extent_.size(); ++d) row_bytes_ *= extent_[d];
  filters_ = FiltersOf(made.get());
  const bool known = std::all_of(filters_.begin(), filters_.end(), [](int filter) {
    return filter == H5Z_FILTER_DEFLATE || filter == H5Z_FILTER_SHUFFLE ||
           filter == H5Z_FILTER_FLETCHER32;
  });
  readable_ = known && !filters_.empty() && row_bytes_ > 0 && chunk_bytes_ <= kMostKept &&
              chunk_[0] <= kMostKept / row_bytes_;
}

void H5Packed::AddLayer(std::size_t layer, std::uint8_t* rows, std::vector<Piece>* pieces) const {
  std::vector<hsize_t> origin(chunk_.size(), 0);
  origin[0] = layer * chunk_[0];
  for (;;) {
    pieces->push_back({origin, rows, {}});
    std::size_t d = chunk_.size() - 1;
    for (; d > 0; --d) {
      origin[d] += chunk_[d];
      if (origin[d] < extent_[d]) break;
      origin[d] = 0;
    }
    if (d == 0) return;
  }
}

bool H5Packed::Fetch(Piece* piece) const {
  hsize_t size = 0;
  std::uint32_t skipped = 0;
  if (H5Dget_chunk_storage_size(dataset_.get(), piece->origin.data(), &size) < 0 || size == 0) {
    return false;
  }
  piece->packed.resize(size);
  return H5Dread_chunk(dataset_.get(), H5P_DEFAULT, piece->origin.data(), &skipped,
                       piece->packed.data()) >= 0 &&
         skipped == 0;
}

bool H5Packed::Unpack(Piece* piece) const {
  thread_local std::vector<std::uint8_t> spare;
  std::vector<std::uint8_t>& bytes = piece->packed;
  const auto checksums =
      static_cast<std::size_t>(std::count(filters_.begin(), filters_.end(), H5Z_FILTER_FLETCHER32));
  for (std::size_t f = filters_.size(); f-- > 0;) {
    if (!Undo(filters_[f], element_, chunk_bytes_ + checksums * kChecksum, &bytes, &spare)) {
      return false;
    }
  }
  if (bytes.size() != chunk_bytes_) return false;
  Spread(*piece, bytes.data());
  std::vector<std::uint8_t>().swap(bytes);
  return true;
}

// A chunk's elements to their places among its layer's rows; beyond the extent it holds nothing.
void H5Packed::Spread(const Piece& piece, const std::uint8_t* chunk) const {
  const std::size_t last = chunk_.size() - 1;
  if (last == 0) {
    const hsize_t n = std::min(chunk_[0], extent_[0] - piece.origin[0]);
    std::memcpy(piece.rows, chunk, n * element_);
    return;
  }
  const hsize_t n = std::min(chunk_[last], extent_[last] - piece.origin[last]);
  std::vector<hsize_t> at(chunk_.size(), 0);  // in the chunk
  for (;;) {
    bool inside = true;
    hsize_t from = 0, to = 0;
    for (std::size_t d = 0; d <= last; ++d) {
      const hsize_t place = at[d] + (d == 0 ? 0 : piece.origin[d]);
      inside = inside && at[d] + piece.origin[d] < extent_[d];
      from = from * chunk_[d] + at[d];
      to = to * (d == 0 ? 1 : extent_[d]) + place;
    }
    if (inside) std::memcpy(piece.rows + to * element_, chunk + from * element_, n * element_);
    std::size_t d = last;
    while (d-- > 0) {
      if (++at[d] < chunk_[d]) break;
      at[d] = 0;
    }
    if (d > last) return;
  }
}

bool H5Packed::UnpackLayers(std::size_t from, std::size_t to, std::uint8_t* rows) const {
  std::vector<Piece> pieces;
  for (std::size_t layer = from; layer < to; ++layer) {
    AddLayer(layer, rows + (layer - from) * chunk_[0] * row_bytes_, &pieces);
  }
  std::atomic<bool> good{true};
  for (std::size_t begun = 0; begun < pieces.size() && good;) {
    std::size_t fetched = begun, size = 0;
    for (; fetched < pieces.size() && size < kMostPacked; ++fetched) {
      if (!Fetch(&pieces[fetched])) return false;
      size += pieces[fetched].packed.size();
    }
    ParallelFor(fetched - begun, 0, [&](std::size_t i) {
      if (!Unpack(&pieces[begun + i])) good = false;
    });
    begun = fetched;
  }
  return good;
}

bool H5Packed::Read(std::size_t first, std::size_t count, void* out) {
  if (!readable_) return false;
  auto* rows = static_cast<std::uint8_t*>(out);
  const std::size_t tall = chunk_[0], end = first + count;
  while (first < end) {
    const std::size_t layer = first / tall;
    std::size_t next = std::min((layer + 1) * tall, end);
    if (first == layer * tall && (next == (layer + 1) * tall || next == extent_[0])) {
      // Those that are wanted whole go where they are wanted.
      const std::size_t to = end == extent_[0] ? (end + tall - 1) / tall : end / tall;
      if (!UnpackLayers(layer, to, rows)) return false;
      next = std::min(to * tall, end);
    } else {
      if (kept_ != layer) {
        kept_ = SIZE_MAX;
        kept_rows_.resize(tall * row_bytes_);
        if (!UnpackLayers(layer, layer + 1, kept_rows_.data())) return false;
        kept_ = layer;
      }
      std::memcpy(rows, kept_rows_.data() + (first - layer * tall) * row_bytes_,
                  (next - first) * row_bytes_);
    }
    rows += (next - first) * row_bytes_;
    first = next;
  }
  return true;
}

H5Packer::H5Packer(hid_t dataset, hid_t memory_type) : dataset_(dataset) {
  const H5Handle type(H5Dget_type(dataset), H5Tclose);
  const H5Handle space(H5Dget_space(dataset), H5Sclose);
  const H5Handle made(H5Dget_create_plist(dataset), H5Pclose);
  rank_ = static_cast<std::size_t>(std::max(H5Sget_simple_extent_ndims(space.get()), 0));
  std::vector<hsize_t> extent(rank_), chunk(rank_);
  const std::vector<int> ours = {H5Z_FILTER_SHUFFLE, H5Z_FILTER_DEFLATE, H5Z_FILTER_FLETCHER32};
  if (rank_ == 0 || H5Tequal(type.get(), memory_type) <= 0 || FiltersOf(made.get()) != ours ||
      H5Pget_chunk(made.get(), static_cast<int>(rank_), chunk.data()) < 0) {
    return;
  }
  H5Sget_simple_extent_dims(space.get(), extent.data(), nullptr);
  if (!std::equal(chunk.begin() + 1, chunk.end(), extent.begin() + 1)) return;
  unsigned level = 0, flags = 0;
  std::size_t values = 1;
  H5Pget_filter_by_id2(made.get(), H5Z_FILTER_DEFLATE, &flags, &values, &level, 0, nullptr,
                       nullptr);
  element_ = chunk_bytes_ = H5Tget_size(type.get());
  for (const hsize_t n : chunk) chunk_bytes_ *= n;
  level_ = static_cast<int>(level);
  rows_ = chunk[0];
}

std::ptrdiff_t H5Packer::Write(std::size_t first, std::size_t count, const void* values) const {
  if (rows_ == 0 || first % rows_ != 0) return 0;
  const std::size_t chunks = count / rows_;
  const auto* from = static_cast<const std::uint8_t*>(values);
  const std::size_t at_once = std::max<std::size_t>(1, kMostPacked / chunk_bytes_);
  for (std::size_t begun = 0; begun < chunks; begun += at_once) {
    std::vector<std::vector<std::uint8_t>> packed(std::min(at_once, chunks - begun));
    ParallelFor(packed.size(), 0, [&](std::size_t i) {
      packed[i] = Pack(from + (begun + i) * chunk_bytes_, chunk_bytes_, element_, level_);
    });
    for (std::size_t i = 0; i < packed.size(); ++i) {
      std::vector<hsize_t> origin(rank_, 0);
      origin[0] = first + (begun + i) * rows_;
      if (packed[i].empty() || H5Dwrite_chunk(dataset_, H5P_DEFAULT, 0, origin.data(),
                                              packed[i].size(), packed[i].data()) < 0) {
        return -1;
      }
    }
  }
  return static_cast<std::ptrdiff_t>(chunks * rows_);
}

}  // namespace unfurl::data
