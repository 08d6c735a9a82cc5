#include <algorithm>
#include <deque>

#include "sim/constraints/sparse_ldlt.h"

namespace unfurl::sim {

SparseLdlt::SparseLdlt(int rows, const std::vector<std::uint8_t>& active,
                       const std::vector<Pair>& pairs, int places,
                       const std::vector<std::uint8_t>& constraint)
    : places_(places) {
  // Rows of J, by each row that they wait for, and how many each still waits for.
  std::vector<std::vector<int>> waiting(constraint.empty() ? 0 : rows);
  std::vector<int> left(rows, 0);
  for (const Pair& e : pairs) {
    if (constraint.empty() || constraint[e.row] == constraint[e.column]) continue;
    const int row = constraint[e.row] ? e.row : e.column;
    waiting[constraint[e.row] ? e.column : e.row].push_back(row);
    ++left[row];
  }
  // The graph of what is not yet eliminated: neighbours of each row, with the entry's place.
  std::vector<std::vector<std::pair<int, int>>> graph(rows);
  for (const Pair& e : pairs) {
    graph[e.row].emplace_back(e.column, e.place);
    graph[e.column].emplace_back(e.row, e.place);
  }
  std::vector<std::deque<int>> by_degree;
  std::vector<int> queued(rows, -1);  // degree under which a row was queued last
  std::size_t lowest = 0;
  const auto queue = [&](int row) {
    if (left[row] > 0) return;
    const std::size_t degree = graph[row].size();
    if (queued[row] == static_cast<int>(degree)) return;
    queued[row] = static_cast<int>(degree);
    if (by_degree.size() <= degree) by_degree.resize(degree + 1);
    by_degree[degree].push_back(row);
    lowest = std::min(lowest, degree);
  };
  int remaining = 0;
  for (int row = 0; row < rows; ++row) {
    if (!active[row]) continue;
    queue(row);
    ++remaining;
  }
  std::vector<std::uint8_t> done(rows, 0);
  while (remaining > 0) {
    while (by_degree[lowest].empty()) ++lowest;
    const int row = by_degree[lowest].front();
    by_degree[lowest].pop_front();
    if (done[row] || queued[row] != static_cast<int>(lowest)) continue;  // queued anew elsewhere
    done[row] = 1;
    --remaining;
    const std::vector<std::pair<int, int>> column = std::move(graph[row]);
    for (const auto& [other, place] : column) {
      entries_.push_back({place, other});
      std::erase_if(graph[other], [&](const auto& n) { return n.first == row; });
    }
    steps_.push_back({row, static_cast<int>(column.size())});
    for (std::size_t a = 0; a < column.size(); ++a) {
      for (std::size_t b = a + 1; b < column.size(); ++b) {
        const int first = column[a].first, second = column[b].first;
        const auto found = std::find_if(graph[first].begin(), graph[first].end(),
                                        [&](const auto& n) { return n.first == second; });
        int place = places_;
        if (found != graph[first].end()) {
          place = found->second;
        } else {
          ++places_;
          graph[first].emplace_back(second, place);
          graph[second].emplace_back(first, place);
        }
        target_.push_back(place);
      }
    }
    if (!waiting.empty()) {
      for (const int other : waiting[row]) --left[other];
    }
    for (const auto& entry : column) queue(entry.first);
  }
}

}  // namespace unfurl::sim
