#include "tests/support/victim.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <functional>
#include <stdexcept>
#include <string>

#include "idl/transport/transport.h"
#include "tests/support/own_ports.h"
#include "tests/support/raw_participant.h"

namespace trammel::test {
namespace {

/// Samples whose content nobody reads.
class UnreadType final : public wire::dds::TopicDataType {
 public:
  UnreadType() {
    setName("Type");
    m_typeSize = 1024;
    m_isGetKeyDefined = false;
  }
  bool serialize(void*, eprosima::fastrtps::rtps::SerializedPayload_t*) override { return false; }
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t*, void*) override { return false; }
  std::function<std::uint32_t()> getSerializedSizeProvider(void*) override {
    return [] { return 0u; };
  }
  void* createData() override { return new int; }
  void deleteData(void* data) override { delete static_cast<int*>(data); }
  bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

void limit(int resource, rlim_t most) {
  const rlimit both{most, most};
  ::setrlimit(static_cast<__rlimit_resource_t>(resource), &both);
}

[[noreturn]] void live(std::uint16_t port, bool guarded, int ready) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  limit(RLIMIT_AS, 4ull << 30);
  limit(RLIMIT_CPU, 40);
  limit(RLIMIT_CORE, 0);
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ::dup2(nowhere, STDERR_FILENO);
  wire::ParticipantOptions options{"victim", Victim::kDomain, "127.0.0.1", port, {}};
  if (!guarded) options.dropped = nullptr;
  const auto participant = wire::make_participant(options);
  if (!participant) ::_exit(1);
  wire::dds::TypeSupport type(new UnreadType);
  type.register_type(participant->get());
  auto* topic = (*participant)->create_topic("Topic", "Type", wire::dds::TOPIC_QOS_DEFAULT);
  auto* reader = (*participant)
                     ->create_subscriber(wire::subscriber_qos({}))
                     ->create_datareader(topic, wire::call_reader_qos(16));
  if (reader == nullptr || ::write(ready, "r", 1) != 1) ::_exit(1);
  while (true) ::pause();
}

}  // namespace

Victim::Victim(bool guarded) : port_(static_cast<std::uint16_t>(own_ports() + (guarded ? 1 : 0))) {
  int ready[2];
  if (::pipe(ready) != 0) throw std::runtime_error("no pipe");
  process_ = ::fork();
  if (process_ == 0) live(port_, guarded, ready[1]);
  ::close(ready[1]);
  char said = 0;
  const bool lives = process_ > 0 && ::read(ready[0], &said, 1) == 1;
  ::close(ready[0]);
  if (!lives) throw std::runtime_error("the victim does not live");
}

Victim::~Victim() {
  if (ended_) return;
  ::kill(process_, SIGKILL);
  ::waitpid(process_, nullptr, 0);
}

bool Victim::is_dead() {
  if (!ended_) ended_ = ::waitpid(process_, nullptr, WNOHANG) == process_;
  return ended_;
}

bool Victim::answers(std::chrono::milliseconds limit) const {
  static unsigned seed = 1000;
  RawParticipant other(port_, kDomain, ++seed);
  return other.meet(limit) && other.become_writer(0x00000203, limit);
}

std::size_t Victim::peak_mib() const {
  std::ifstream status("/proc/" + std::to_string(process_) + "/status");
  std::string word;
  while (status >> word) {
    std::size_t kib = 0;
    if (word == "VmHWM:" && status >> kib) return kib / 1024;
  }
  return 0;
}

}  // namespace trammel::test
