#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "data/h5_handle.h"

namespace unfurl::data {

// A packed dataset of numbers, unpacked here, on all cores: HDF5 unpacks with zlib, one chunk after
// the other, in two to three times the CPU time, and a chunk anew for each of its rows that is
// asked for by itself. What is damaged or stored in another way is left to HDF5, which says what it
// is. HDF5 itself is called on the caller's thread alone. Not for several threads at once.
class H5Packed {
 public:
  // Memory is of `memory_type`, in which the dataset has to be stored.
  H5Packed(H5Handle dataset, hid_t memory_type);

  // Rows [first, first + count), which the dataset has, into out. False: ask HDF5.
  bool Read(std::size_t first, std::size_t count, void* out);

 private:
  struct Piece {  // a chunk, and where its rows go
    std::vector<hsize_t> origin;
    std::uint8_t* rows = nullptr;  // of its layer: all columns
    std::vector<std::uint8_t> packed;
  };
  void AddLayer(std::size_t layer, std::uint8_t* rows, std::vector<Piece>* pieces) const;
  bool Fetch(Piece* piece) const;
  bool Unpack(Piece* piece) const;
  void Spread(const Piece& piece, const std::uint8_t* chunk) const;

  bool UnpackLayers(std::size_t from, std::size_t to, std::uint8_t* rows) const;

  H5Handle dataset_;
  bool readable_ = false;
  std::vector<int> filters_;             // in the order of packing
  std::vector<hsize_t> extent_, chunk_;  // [rows, ...]
  std::size_t element_ = 0, row_bytes_ = 0, chunk_bytes_ = 0;
  std::size_t kept_ = SIZE_MAX;  // the layer of chunks that was asked for in part
  std::vector<std::uint8_t> kept_rows_;
};

// The other way: whole chunks of a series that grows, packed here, on all cores.
class H5Packer {
 public:
  // Of a dataset that the caller keeps open. Packs nothing unless values in memory are as in the
  // file, chunks hold whole rows, and the filters are ours: shuffle, deflate, Fletcher's checksum.
  H5Packer(hid_t dataset, hid_t memory_type);

  // How many of `count` rows, to be rows `first` and on, it wrote: those of whole chunks from the
  // first one on. The dataset has room for them. -1: HDF5 failed.
  std::ptrdiff_t Write(std::size_t first, std::size_t count, const void* values) const;

 private:
  hid_t dataset_;
  std::size_t rows_ = 0;  // of a chunk; 0: nothing is packed here
  std::size_t rank_ = 0, element_ = 0, chunk_bytes_ = 0;
  int level_ = 0;
};

// Fletcher's checksum as HDF5 stores it, over words of 16 bits, the high byte first.
std::uint32_t H5Fletcher32(const std::uint8_t* data, std::size_t size);

}  // namespace unfurl::data
