#pragma once

#include <array>
#include <cstdint>
#include <memory>

#include "idl/repairs/guard/dropped.h"
#include "idl/repairs/guard/recent_table.h"

namespace trammel::wire {

/// The fields of a DATA_FRAG.
struct Fragments {
  std::uint32_t writer = 0;
  std::int64_t sequence_number = 0;
  std::uint32_t first = 0;  ///< from 1
  std::uint32_t count = 0;
  std::uint32_t size = 0;  ///< bytes of a fragment but the last
  std::uint32_t sample_size = 0;

  [[nodiscard]] std::uint32_t of_sample() const { return (sample_size + size - 1) / size; }
};

/// Samples that arrive in fragments. The library reserves the whole sample with its first fragment
/// and keeps it for as long as its writer lives, so what is begun and unfinished is bounded, per
/// participant and in all.
class UnfinishedSamples {
 public:
  using Time = std::chrono::steady_clock::time_point;
  static constexpr std::uint64_t kMostBytes = 512u << 20;       ///< of all participants
  static constexpr std::uint64_t kMostBytesOfOne = 128u << 20;  ///< of one
  static constexpr std::chrono::seconds kForgottenAfter{20};    ///< without a new fragment

  [[nodiscard]] std::optional<Dropped> add(Bytes prefix, const Fragments& fragments, Time now);

 private:
  struct Sample {
    EndpointKey writer;
    std::int64_t sequence_number = 0;  // 0: free
    std::uint32_t size = 0;            // of a fragment
    std::uint32_t sample_size = 0;
    std::uint32_t missing = 0;  // fragments
    Time seen{};
  };
  static constexpr std::size_t kSamples = 512;
  std::optional<Dropped> begin(const EndpointKey& writer, const Fragments& fragments, Time now);

  std::unique_ptr<std::array<Sample, kSamples>> samples_ =
      std::make_unique<std::array<Sample, kSamples>>();
};

/// Samples that were sent in fragments: the library sends whatever fragment somebody asks for, also
/// beyond the sample.
class SentSamples {
 public:
  void add(const Fragments& fragments);
  /// Bytes of each fragment of the sample; 0: it has no such one.
  [[nodiscard]] std::uint32_t fragment_bytes(std::uint32_t writer, std::int64_t sequence_number,
                                             std::uint32_t fragment) const;

 private:
  struct Sample {
    std::uint32_t writer = 0;
    std::uint32_t fragments = 0;
    std::uint32_t size = 0;            // of a fragment
    std::int64_t sequence_number = 0;  // 0: free
  };
  static constexpr std::size_t kSets = 1024;
  using Set = std::array<Sample, 4>;
  static std::size_t place(std::uint32_t writer, std::int64_t sequence_number);

  std::unique_ptr<std::array<Set, kSets>> sets_ = std::make_unique<std::array<Set, kSets>>();
};

}  // namespace trammel::wire
