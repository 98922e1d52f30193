// Sends mutated RTPS packets to a running daemon: mutated_packets PORT DOMAIN PACKETS [SEED]
#include <cstdio>
#include <cstdlib>

#include "tests/support/mutated_packets.h"

int main(int argc, char** argv) {
  if (argc < 4) {
    std::fprintf(stderr, "usage: %s PORT DOMAIN PACKETS [SEED]\n", argv[0]);
    return 2;
  }
  trammel::test::MutatedPackets packets(static_cast<std::uint16_t>(std::atoi(argv[1])),
                                        static_cast<std::uint32_t>(std::atoi(argv[2])),
                                        argc > 4 ? static_cast<unsigned>(std::atoi(argv[4])) : 1);
  if (!packets.collect()) {
    std::fprintf(stderr, "nobody answers\n");
    return 1;
  }
  packets.send(static_cast<std::size_t>(std::atoll(argv[3])));
  return 0;
}
