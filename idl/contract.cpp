#include "idl/contract.h"

#include <cstddef>

namespace trammel::wire {

template <>
std::optional<Fault> find_fault<SpokenContract>(std::span<const unsigned char> sample) {
  constexpr std::size_t kText = 64;  // bytes
  CdrWalk walk(sample);
  walk.text("server", kText, Text::kToken);
  walk.longs(1);
  walk.text("program_version", kText, Text::kAny);
  return walk.fault();
}

Result<dds::Topic*> make_contract_topic(dds::DomainParticipant& participant) {
  return make_topic(participant, SpokenContractTopic::kName, new SafeType<SpokenContractTopic::Type>(kMaxStateSample),
                    "trammel::wire::SpokenContract");
}

}  // namespace trammel::wire
