// The order of elimination and the fill of SparseLdlt: least degree first [George and Liu 1989].
#include <algorithm>
#include <deque>

#include "sim/constraints/sparse_ldlt.h"

namespace unfurl::sim {
namespace {

// The rows not yet eliminated: neighbours of each, with the place of the entry between them.
class Graph {
 public:
  struct Edge {
    int row, place;
  };
  Graph(int rows, const std::vector<SparseLdlt::Pair>& pairs) : edges_(rows) {
    for (const SparseLdlt::Pair& e : pairs) Join(e.row, e.column, e.place);
  }

  std::size_t Degree(int row) const { return edges_[row].size(); }

  // Takes the row out; returns its edges, which are its column of L.
  std::vector<Edge> Eliminate(int row) {
    std::vector<Edge> column = std::move(edges_[row]);
    for (const Edge& edge : column) {
      std::erase_if(edges_[edge.row], [&](const Edge& back) { return back.row == row; });
    }
    return column;
  }

  // The place of the entry of two rows; where there was none it is fill, and takes `*places`.
  int PlaceOf(int first, int second, int* places) {
    const auto found = std::find_if(edges_[first].begin(), edges_[first].end(),
                                    [&](const Edge& edge) { return edge.row == second; });
    if (found != edges_[first].end()) return found->place;
    Join(first, second, *places);
    return (*places)++;
  }

 private:
  void Join(int a, int b, int place) {
    edges_[a].push_back({b, place});
    edges_[b].push_back({a, place});
  }

  std::vector<std::vector<Edge>> edges_;
};

// Rows by degree, the oldest first among equals. A row whose degree changed is queued anew; the
// entry under its old degree is passed over.
class DegreeQueue {
 public:
  explicit DegreeQueue(int rows) : queued_(rows, -1), done_(rows, 0) {}

  void Push(int row, std::size_t degree) {
    if (queued_[row] == static_cast<int>(degree)) return;
    queued_[row] = static_cast<int>(degree);
    if (by_degree_.size() <= degree) by_degree_.resize(degree + 1);
    by_degree_[degree].push_back(row);
    lowest_ = std::min(lowest_, degree);
  }

  int Pop() {
    for (;;) {
      while (by_degree_[lowest_].empty()) ++lowest_;
      const int row = by_degree_[lowest_].front();
      by_degree_[lowest_].pop_front();
      if (done_[row] || queued_[row] != static_cast<int>(lowest_)) continue;
      done_[row] = 1;
      return row;
    }
  }

 private:
  std::vector<std::deque<int>> by_degree_;
  std::vector<int> queued_;  // by row: the degree under which it was queued last
  std::vector<std::uint8_t> done_;
  std::size_t lowest_ = 0;
};

// In a saddle-point matrix rows of J have no diagonal of their own: each waits until all rows of W
// that it couples to are eliminated, and then has a negative pivot.
class Waiting {
 public:
  Waiting(int rows, const std::vector<SparseLdlt::Pair>& pairs,
          const std::vector<std::uint8_t>& constraint)
      : waiting_(constraint.empty() ? 0 : rows), left_(rows, 0) {
    if (constraint.empty()) return;
    for (const SparseLdlt::Pair& e : pairs) {
      if (constraint[e.row] == constraint[e.column]) continue;
      const int row = constraint[e.row] ? e.row : e.column;
      waiting_[constraint[e.row] ? e.column : e.row].push_back(row);
      ++left_[row];
    }
  }

  bool IsReady(int row) const { return left_[row] == 0; }

  void Eliminated(int row) {
    if (waiting_.empty()) return;
    for (const int other : waiting_[row]) --left_[other];
  }

 private:
  std::vector<std::vector<int>> waiting_;  // rows of J, by each row that they wait for
  std::vector<int> left_;                  // how many each still waits for
};

}  // namespace

SparseLdlt::SparseLdlt(int rows, const std::vector<std::uint8_t>& active,
                       const std::vector<Pair>& pairs, int places,
                       const std::vector<std::uint8_t>& constraint)
    : places_(places) {
  Waiting waiting(rows, pairs, constraint);
  Graph graph(rows, pairs);
  DegreeQueue queue(rows);
  const auto push_if_ready = [&](int row) {
    if (waiting.IsReady(row)) queue.Push(row, graph.Degree(row));
  };
  int remaining = 0;
  for (int row = 0; row < rows; ++row) {
    if (!active[row]) continue;
    push_if_ready(row);
    ++remaining;
  }
  for (; remaining > 0; --remaining) {
    const int row = queue.Pop();
    const std::vector<Graph::Edge> column = graph.Eliminate(row);
    for (const Graph::Edge& edge : column) entries_.push_back({edge.place, edge.row});
    steps_.push_back({row, static_cast<int>(column.size())});
    // Elimination couples the row's neighbours to one another.
    for (std::size_t a = 0; a < column.size(); ++a) {
      for (std::size_t b = a + 1; b < column.size(); ++b) {
        target_.push_back(graph.PlaceOf(column[a].row, column[b].row, &places_));
      }
    }
    waiting.Eliminated(row);
    for (const Graph::Edge& edge : column) push_if_ready(edge.row);
  }
}

}  // namespace unfurl::sim
