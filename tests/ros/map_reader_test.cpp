// What test_map_reader.py says of the reader in Python, of the one in C++.
#include <cstdio>
#include <cstdlib>
#include <initializer_list>
#include <utility>

#include "map_reader.hpp"

using Array = MapReader::Array;
using Members = std::initializer_list<std::pair<std::uint64_t, std::uint32_t>>;  // id, revision

Array message(std::uint64_t session, std::uint64_t sequence, Members members, std::initializer_list<std::uint64_t> removed = {},
              std::int32_t second = 0) {
  Array array;
  array.header.stamp.sec = second;
  array.session_id = session;
  array.sequence = sequence;
  array.base_sequence = sequence - 1;
  for (auto [id, revision] : members) {
    array.clusters.emplace_back();
    array.clusters.back().id = id;
    array.clusters.back().revision = revision;
  }
  array.removed = removed;
  return array;
}

void expect(const char* sentence, const MapReader& reader, std::uint64_t version, Members members) {
  bool same = reader.version() == version && reader.clusters().size() == members.size();
  for (auto [id, revision] : members) {
    auto found = reader.clusters().find(id);
    same = same && found != reader.clusters().end() && found->second.revision == revision;
  }
  if (same) return;
  std::fprintf(stderr, "not so: %s\n", sentence);
  std::exit(1);
}

void played_again() {
  MapReader reader;
  reader.snapshot(message(1, 1, {{1, 1}}, {}, 100));
  reader.snapshot(message(1, 60, {{1, 60}}, {}, 102));
  reader.delta(message(1, 61, {{1, 61}}, {}, 103));
  reader.delta(message(1, 64, {{1, 64}}, {}, 104));
  expect("a recording is played", reader, 61, {{1, 61}});
  reader.snapshot(message(1, 1, {{1, 1}}, {}, 100));
  reader.delta(message(1, 2, {{2, 1}}, {}, 101));
  expect("played again it begins a new map though its session is the same", reader, 2, {{1, 1}, {2, 1}});
  reader.snapshot(message(1, 63, {{1, 63}}, {}, 103));
  expect("and what waited before is gone", reader, 63, {{1, 63}});
}

void late() {
  MapReader reader;
  reader.snapshot(message(1, 1, {{1, 1}}, {}, 100));
  for (std::uint32_t sequence = 2; sequence < 5; ++sequence) {
    reader.delta(message(1, sequence, {{1, sequence}}, {}, 100 + 10 * static_cast<std::int32_t>(sequence)));
  }
  reader.snapshot(message(1, 1, {{1, 1}}, {}, 100));
  expect("a snapshot that comes again is no recording", reader, 4, {{1, 4}});
  reader.snapshot(message(1, 3, {{1, 3}}, {}, 130));
  expect("nor is one that is late, however seldom they are", reader, 4, {{1, 4}});
  reader.snapshot(message(1, 2, {{1, 2}}, {}, 140));
  expect("nor one whose stamp is that of the map", reader, 4, {{1, 4}});
}

int main() {
  played_again();
  late();
  MapReader reader;
  reader.delta(message(1, 2, {{1, 2}}));
  reader.delta(message(1, 3, {{3, 1}}, {2}));
  if (reader.version()) return 2;
  reader.snapshot(message(1, 2, {{1, 2}, {2, 1}}));
  expect("deltas wait for a snapshot; those up to its version are dropped", reader, 3, {{1, 2}, {3, 1}});
  reader.snapshot(message(1, 2, {{1, 2}, {2, 1}}));
  expect("a snapshot that is older than the map changes nothing", reader, 3, {{1, 2}, {3, 1}});
  reader.delta(message(1, 5, {{4, 1}}));
  expect("on a gap the reader waits", reader, 3, {{1, 2}, {3, 1}});
  reader.snapshot(message(1, 4, {{1, 4}}));
  expect("and goes on from the next snapshot", reader, 5, {{1, 4}, {4, 1}});
  reader.delta(message(2, 1, {{1, 1}}));
  expect("a delta of a new session waits for its snapshot", reader, 5, {{1, 4}, {4, 1}});
  reader.snapshot(message(2, 0, {}));
  expect("which begins a new map", reader, 1, {{1, 1}});
}
