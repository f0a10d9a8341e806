// SPDX-License-Identifier: Apache-2.0
#include <tools/view_history.h>

namespace stipple {

void EditHistory::add(Step step) {
    steps_.resize(done_);
    steps_.push_back(std::move(step));
    ++done_;
}

void EditHistory::insert(SceneEditor& editor, uint32_t group, ChildRef child,
                         const std::vector<Affine>& transforms) {
    Step step;
    try {
        for (const Affine& transform : transforms)
            step.push_back({editor.insert(group, child, transform), {}, {child, transform}});
    } catch (const Error&) {
        if (!step.empty()) add(std::move(step));
        throw;
    }
    if (!step.empty()) add(std::move(step));
}

void EditHistory::remove(SceneEditor& editor, InstanceId id) {
    const State before = {editor.child(id), editor.groupFromChild(id)};
    editor.remove(id);
    add({{id, before, {}}});
}

void EditHistory::move(SceneEditor& editor, InstanceId id, const Affine& transform) {
    const State before = {editor.child(id), editor.groupFromChild(id)};
    editor.move(id, transform);
    add({{id, before, {before.child, transform}}});
}

void EditHistory::change(SceneEditor& editor, InstanceId id, const State& from, const State& to) {
    if (to.child.isNone()) {
        editor.remove(id);
    } else if (from.child.isNone()) {
        editor.restore(id, to.child, to.transform);
    } else {
        editor.move(id, to.transform);
    }
}

bool EditHistory::undo(SceneEditor& editor) {
    if (done_ == 0) return false;
    const Step& step = steps_[--done_];
    for (size_t i = step.size(); i-- > 0;)
        change(editor, step[i].id, step[i].after, step[i].before);
    return true;
}

bool EditHistory::redo(SceneEditor& editor) {
    if (done_ == steps_.size()) return false;
    for (const Change& c : steps_[done_++]) change(editor, c.id, c.before, c.after);
    return true;
}

}  // namespace stipple
