#include "idl/repairs/guard/fragment_watch.h"

#include <algorithm>

namespace trammel::wire {

std::optional<Dropped> UnfinishedSamples::add(Bytes prefix, const Fragments& fragments, Time now) {
  const EndpointKey writer = key_of(prefix, fragments.writer);
  for (Sample& sample : *samples_) {
    if (sample.sequence_number != fragments.sequence_number || sample.writer != writer) continue;
    if (sample.size != fragments.size || sample.sample_size != fragments.sample_size)
      return Dropped::kFragment;
    sample.seen = now;
    sample.missing -= std::min(sample.missing, fragments.count);
    return {};
  }
  return begin(writer, fragments, now);
}

std::optional<Dropped> UnfinishedSamples::begin(const EndpointKey& writer,
                                                const Fragments& fragments, Time now) {
  std::uint64_t all = 0, of_one = 0;
  Sample* place = nullptr;  // free, or finished longest ago
  for (Sample& sample : *samples_) {
    if (sample.missing > 0 && now - sample.seen > kForgottenAfter) sample = Sample();
    if (sample.missing > 0) {
      all += sample.sample_size;
      if (sample.writer.prefix == writer.prefix) of_one += sample.sample_size;
    } else if (place == nullptr || sample.seen < place->seen) {
      place = &sample;
    }
  }
  if (place == nullptr || all + fragments.sample_size > kMostBytes) return Dropped::kMemory;
  if (of_one + fragments.sample_size > kMostBytesOfOne) return Dropped::kMemory;
  *place = {writer,
            fragments.sequence_number,
            fragments.size,
            fragments.sample_size,
            fragments.of_sample() - std::min(fragments.of_sample(), fragments.count),
            now};
  return {};
}

std::size_t SentSamples::place(std::uint32_t writer, std::int64_t sequence_number) {
  const std::uint64_t mixed =
      (std::uint64_t{writer} << 32 ^ static_cast<std::uint64_t>(sequence_number)) *
      0x9e3779b97f4a7c15u;
  return static_cast<std::size_t>(mixed >> 40) % kSets;
}

void SentSamples::add(const Fragments& fragments) {
  Set& set = (*sets_)[place(fragments.writer, fragments.sequence_number)];
  Sample* into = set.data();
  for (Sample& sample : set) {
    if (sample.writer == fragments.writer && sample.sequence_number == fragments.sequence_number)
      return;
    if (sample.sequence_number < into->sequence_number) into = &sample;
  }
  *into = {fragments.writer, fragments.of_sample(), fragments.size, fragments.sequence_number};
}

std::uint32_t SentSamples::fragment_bytes(std::uint32_t writer, std::int64_t sequence_number,
                                          std::uint32_t fragment) const {
  for (const Sample& sample : (*sets_)[place(writer, sequence_number)]) {
    if (sample.writer == writer && sample.sequence_number == sequence_number &&
        fragment <= sample.fragments)
      return sample.size;
  }
  return 0;
}

}  // namespace trammel::wire
