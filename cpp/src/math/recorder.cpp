// What becomes of the steps that were noted: a program, or a text.
#include "sysid/math/recorder.hpp"

#include <algorithm>

#include "sysid/math/whole.hpp"

namespace sysid {

int Recorder::partner_of(int node) const {
    const Node& n = nodes_[index(node)];
    if (n.uniform) return -1;
    if (n.op == Op::kSin) return node + 1;
    return n.op == Op::kCos ? node - 1 : -1;
}

Spelled Recorder::spelled(const std::vector<Recorded>& outputs) {
    Spelled out;
    for (const Recorded& x : outputs) out.outputs.push_back(node_of(x));
    for (const Node& n : nodes_) out.steps.push_back({n.op, n.a, n.b, n.c, n.constant});
    out.inputs = inputs_;
    out.names = names_;
    out.parts = parts_;
    return out;
}

Program Recorder::program(const std::vector<Recorded>& outputs) const {
    std::vector<bool> needed(nodes_.size(), false), kept(nodes_.size(), false);
    for (const Recorded& x : outputs)
        if (x.to_ != nullptr) needed[index(x.node_)] = kept[index(x.node_)] = true;
    for (std::size_t i = nodes_.size(); i-- > 0;) {
        if (!needed[i]) continue;
        if (const int partner = partner_of(static_cast<int>(i)); partner >= 0)
            needed[index(partner)] = kept[index(partner)] = true;
        for (const int operand : {nodes_[i].a, nodes_[i].b, nodes_[i].c}) {
            if (operand < 0) continue;
            needed[index(operand)] = true;
            if (!nodes_[i].uniform) kept[index(operand)] = true;
        }
    }
    Program out;
    std::vector<int> rows(nodes_.size() + 1, -1);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const Node& n = nodes_[i];
        if (!needed[i] || (n.uniform && !kept[i])) continue;
        rows[i] = out.rows++;
        if (n.uniform) out.uniform.emplace_back(rows[i], n.value);
    }
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
        const Node& n = nodes_[i];
        if (rows[i] < 0 || n.uniform || n.op == Op::kInput || n.op == Op::kCos) continue;
        ForwardStep step;
        step.op = n.op;
        step.to = rows[i];
        step.constant = n.constant;
        if (n.a >= 0) step.a = rows[index(n.a)];
        if (n.b >= 0) step.b = rows[index(n.b)];
        if (n.c >= 0) step.c = rows[index(n.c)];
        if (n.op == Op::kSin) step.b = rows[index(partner_of(static_cast<int>(i)))];
        out.steps.push_back(step);
    }
    for (const int i : inputs_) out.inputs.push_back(rows[index(i)]);
    std::vector<int> nodes, group;
    for (std::size_t o = 0; o < outputs.size(); ++o) {
        const Recorded& x = outputs[o];
        int same_as = -1;
        if (x.to_ == nullptr) {
            out.outputs.push_back(out.rows++);
            out.uniform.emplace_back(out.outputs.back(), x.v_);
        } else {
            out.outputs.push_back(rows[index(x.node_)]);
            for (std::size_t i = 0; i < inputs_.size(); ++i)
                if (inputs_[i] == x.node_ && nodes_[index(x.node_)].active)
                    same_as = static_cast<int>(i);
        }
        out.same_as.push_back(same_as);
        nodes.push_back(x.node_);
        if (x.to_ != nullptr && same_as < 0 && nodes_[index(x.node_)].active)
            group.push_back(static_cast<int>(o));
    }
    for (std::size_t first = 0; first < group.size(); first += kSweep) {
        const std::size_t last = std::min(group.size(), first + kSweep);
        add_sweep(nodes,
                  {group.begin() + static_cast<std::ptrdiff_t>(first),
                   group.begin() + static_cast<std::ptrdiff_t>(last)},
                  rows, out);
    }
    return out;
}

void Recorder::add_sweep(const std::vector<int>& nodes, const std::vector<int>& outputs,
                         const std::vector<int>& rows, Program& out) const {
    Sweep sweep;
    sweep.outputs = outputs;
    std::vector<int> slots(nodes_.size(), -1), unused;
    const auto slot_for = [&](int node) {
        int& slot = slots[index(node)];
        if (slot >= 0) return false;
        if (unused.empty()) {
            slot = sweep.slots++;
        } else {
            slot = unused.back();
            unused.pop_back();
        }
        return true;
    };
    for (const int o : outputs) {
        slot_for(nodes[index(o)]);
        sweep.seeds.push_back(slots[index(nodes[index(o)])]);
    }
    for (std::size_t i = nodes_.size(); i-- > 0;) {
        const Node& n = nodes_[i];
        if (slots[i] < 0 || n.op == Op::kInput) continue;
        BackwardStep step;
        step.op = n.uniform ? Op::kUniform : n.op;
        step.slot = slots[i];
        step.to = rows[i];
        step.constant = n.constant;
        step.slope_a = n.slope_a;
        step.slope_b = n.slope_b;
        if (n.a >= 0) step.a = rows[index(n.a)];
        if (n.b >= 0) step.b = rows[index(n.b)];
        if (const int partner = partner_of(static_cast<int>(i)); partner >= 0)
            step.b = rows[index(partner)];
        const auto operand = [&](int node, std::int32_t& slot, bool& first) {
            if (node < 0 || !nodes_[index(node)].active) return;
            first = slot_for(node);
            slot = slots[index(node)];
        };
        if (n.op != Op::kIfBelow) operand(n.a, step.slot_a, step.first_a);
        operand(n.b, step.slot_b, step.first_b);
        operand(n.c, step.slot_c, step.first_c);
        sweep.steps.push_back(step);
        unused.push_back(slots[i]);
    }
    for (const int i : inputs_) sweep.inputs.push_back(slots[index(i)]);
    out.slots = std::max(out.slots, sweep.slots);
    out.sweeps.push_back(std::move(sweep));
}

}  // namespace sysid
