// Objects that change with every call, as Python holds them: calls from several threads take turns,
// and the state pickles and copies.
#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "arrays.hpp"
#include "sysid/math/state_row.hpp"

namespace sysid::bindings {

/// One object and its lock. Nobody who waits for the object's lock holds the interpreter's, so that
/// a kernel which has the object may take the interpreter's to ask for signals.
template <class T>
class Guarded {
  public:
    template <class... Arguments>
    explicit Guarded(Arguments&&... arguments) : object_(std::forward<Arguments>(arguments)...) {}

    /// Calls `use(object)` alone and without the interpreter lock. No Python object may be touched.
    template <class Use>
    auto with(Use&& use) {
        return unlocked([&] {
            const std::scoped_lock alone(lock_);
            return use(object_);
        });
    }
    T snapshot() {
        return with([](const T& object) { return object; });
    }

  private:
    T object_;
    std::mutex lock_;
};

/// Adds `copy()` and what pickle and copy.deepcopy ask for. `blank()` makes an object of any state.
template <class T, class Blank>
void add_state(py::class_<Guarded<T>>& bound, Blank&& blank) {
    using Held = Guarded<T>;
    bound.def("copy", [](Held& self) { return std::make_unique<Held>(self.snapshot()); })
        .def(py::pickle([](Held& self) { return row_of(StateWriter::row_of(self.snapshot())); },
                        [blank](const Array& stored) {
                            T object = blank();
                            StateReader::restore(object,
                                                 {stored.data(), stored.data() + stored.size()});
                            return std::make_unique<Held>(std::move(object));
                        }));
}

}  // namespace sysid::bindings
