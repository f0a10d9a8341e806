// SPDX-License-Identifier: Apache-2.0
#include <tools/view_history.h>

namespace stipple {

void EditHistory::add(const Step& step) {
    steps_.resize(done_);
    steps_.push_back(step);
    ++done_;
}

void EditHistory::insert(SceneEditor& editor, uint32_t group, ChildRef child,
                         const Affine& transform) {
    add({editor.insert(group, child, transform), {}, {child, transform}});
}

void EditHistory::remove(SceneEditor& editor, InstanceId id) {
    const State before = {editor.child(id), editor.groupFromChild(id)};
    editor.remove(id);
    add({id, before, {}});
}

void EditHistory::move(SceneEditor& editor, InstanceId id, const Affine& transform) {
    const State before = {editor.child(id), editor.groupFromChild(id)};
    editor.move(id, transform);
    add({id, before, {before.child, transform}});
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
    change(editor, step.id, step.after, step.before);
    return true;
}

bool EditHistory::redo(SceneEditor& editor) {
    if (done_ == steps_.size()) return false;
    const Step& step = steps_[done_++];
    change(editor, step.id, step.before, step.after);
    return true;
}

}  // namespace stipple
