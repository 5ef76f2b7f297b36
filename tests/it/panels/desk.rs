//! A panel without a window: frames are run with raw input, and widgets are found by what they tell screen readers.

use bevy::prelude::*;
use bevy_egui::egui::{self, Event, Key, Modifiers, PointerButton, Pos2, RawInput, Rect, accesskit};
use rigsmith::{
    editor::{
        ActiveRig,
        panel::{EditorOverlay, EditorPanel, Panels, Requests},
        panels::{PanelsPlugin, log::LogBook},
    },
    headless::headless_app,
    plugins::history::RigHistory,
    prelude::*,
    rig::TagKind,
    test_app::strict_app,
};

/// Sheet that lies on a desk.
pub enum Sheet {
    Panel(Box<dyn EditorPanel>),
    Overlay(Box<dyn EditorOverlay>),
    /// Everything over the viewport that the app's plugins have added, in a window of its own.
    Window,
}

/// An app with a rig, and one panel of it.
pub struct Desk {
    pub app: App,
    pub rig: Entity,
    pub ctx: egui::Context,
    sheet: Sheet,
    size: egui::Vec2,
    pub time: f64,
    events: Vec<Event>,
    /// Everything in the last frame: what it says, its value, and where it is.
    pub seen: Vec<ShownWidget>,
    held: Modifiers,
    /// Number of shapes that the last frame was drawn with.
    pub shapes: usize,
    /// Texts of the last frame.
    pub texts: Vec<DrawnText>,
    /// Nothing that the panel asks for is done.
    pub deaf: bool,
    /// True if the last frame asked for another one at once.
    pub awake: bool,
    /// True if the last frame sent requests, for which the window draws another one.
    pub asks: bool,
    /// Time after which the last frame asked for another one.
    pub wakes_in: std::time::Duration,
}

/// A widget.
#[derive(Debug, Clone)]
pub struct ShownWidget {
    pub label: String,
    pub value: String,
    pub rect: Rect,
    pub on: Option<bool>,
    pub enabled: bool,
    /// True if it can have the keyboard and be clicked.
    pub clickable: bool,
}

/// A text as it is drawn.
#[derive(Debug, Clone)]
pub struct DrawnText {
    pub text: String,
    /// Size of the pictures of its letters.
    pub size: f32,
    /// Height of its lines on the screen.
    pub height: f32,
}

fn drawn_texts<'a>(shapes: impl Iterator<Item = &'a egui::Shape>) -> Vec<DrawnText> {
    let mut open: Vec<&egui::Shape> = shapes.collect();
    let mut texts = Vec::new();
    while let Some(shape) = open.pop() {
        match shape {
            egui::Shape::Vec(parts) => open.extend(parts),
            egui::Shape::Text(shape) => {
                let galley = &shape.galley;
                let Some(section) = galley.job.sections.first() else { continue };
                let (size, height) = (section.format.font_id.size, galley.size().y);
                texts.push(DrawnText { text: galley.job.text.clone(), size, height });
            }
            _ => {}
        }
    }
    texts
}

impl Desk {
    pub fn new(panel: impl EditorPanel) -> Self {
        Self::with(Sheet::Panel(Box::new(panel)), egui::vec2(300.0, 600.0))
    }

    pub fn with(sheet: Sheet, size: egui::Vec2) -> Self {
        let mut app = headless_app(1);
        app.add_plugins(PanelsPlugin);
        let mut app = strict_app(app);
        let rig = app.world_mut().spawn(Rig::new(Uid(1), "rig")).id();
        app.insert_resource(ActiveRig(rig));
        Self::of(app, rig, sheet, size)
    }

    /// An app of its own, ready for updates.
    pub fn of(app: App, rig: Entity, sheet: Sheet, size: egui::Vec2) -> Self {
        let ctx = egui::Context::default();
        ctx.enable_accesskit();
        let mut desk = Self {
            app,
            rig,
            ctx,
            sheet,
            size,
            time: 0.0,
            events: Vec::new(),
            seen: Vec::new(),
            held: Modifiers::NONE,
            shapes: 0,
            texts: Vec::new(),
            deaf: false,
            awake: false,
            asks: false,
            wakes_in: std::time::Duration::MAX,
        };
        desk.frame();
        desk
    }

    /// Draws a frame and lets the app carry out what was asked for.
    pub fn frame(&mut self) {
        self.time += 1.0 / 60.0;
        let input = RawInput {
            screen_rect: Some(Rect::from_min_size(Pos2::ZERO, self.size)),
            time: Some(self.time),
            events: std::mem::take(&mut self.events),
            ..default()
        };
        let mut requests = Requests::default();
        let mut window = match self.sheet {
            Sheet::Window => self.app.world_mut().remove_resource::<Panels>(),
            _ => None,
        };
        let (sheet, world) = (&mut self.sheet, self.app.world());
        let mut output = self.ctx.run_ui(input, |ui| match (&mut *sheet, &mut window) {
            (Sheet::Panel(panel), _) => panel.show(ui, world, &mut requests),
            (Sheet::Overlay(overlay), _) => overlay.show(&ui.ctx().clone(), world, &mut requests),
            (Sheet::Window, panels) => {
                let (ctx, area) = (ui.ctx().clone(), ui.max_rect());
                let panels = panels.as_mut().expect("plugins add panels");
                for painter in &mut panels.painters {
                    painter.widgets(ui, area, world, &mut requests);
                }
                for overlay in &mut panels.overlays {
                    overlay.show(&ctx, world, &mut requests);
                }
            }
        });
        if let Some(window) = window {
            self.app.insert_resource(window);
        }
        self.shapes = output.shapes.len();
        self.texts = drawn_texts(output.shapes.iter().map(|clipped| &clipped.shape));
        let delays = output.viewport_output.values().map(|viewport| viewport.repaint_delay);
        self.wakes_in = delays.min().unwrap_or(std::time::Duration::MAX);
        self.awake = output.viewport_output.values().any(|viewport| viewport.repaint_delay.is_zero());
        output.textures_delta.clear();
        if let Some(update) = output.platform_output.accesskit_update {
            self.seen = update.nodes.iter().filter_map(|(_, node)| shown_widget(node)).collect();
        }
        self.asks = !requests.is_empty();
        if !self.deaf {
            requests.carry_out(self.app.world_mut());
        }
        self.app.update();
    }

    pub fn frames(&mut self, count: usize) {
        (0..count).for_each(|_| self.frame());
    }

    pub fn resize(&mut self, width: f32, height: f32) {
        self.size = egui::vec2(width, height);
        self.frames(3);
    }

    /// Runs frames until something is so, which work in the background brings.
    #[track_caller]
    pub fn until(&mut self, what: &str, is_so: impl Fn(&Self) -> bool) {
        let start = std::time::Instant::now();
        while !is_so(self) {
            let labels: Vec<&str> = self.seen.iter().map(|seen| seen.label.as_str()).collect();
            assert!(start.elapsed() < crate::bench::HANG, "{what} does not come: {:?} {labels:?}", self.told());
            self.frame();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }

    pub fn look(&self, label: &str) -> Option<&ShownWidget> {
        self.seen.iter().find(|seen| seen.label == label)
    }

    /// True if some text of the last frame is this one.
    pub fn says(&self, text: &str) -> bool {
        self.seen.iter().any(|seen| seen.label == text || seen.value == text)
    }

    #[track_caller]
    pub fn find(&self, label: &str) -> ShownWidget {
        let labels: Vec<&str> = self.seen.iter().map(|seen| seen.label.as_str()).collect();
        self.look(label).unwrap_or_else(|| panic!("{label:?} is not among {labels:?}")).clone()
    }

    pub fn hold(&mut self, held: Modifiers) {
        self.held = held;
        self.events.push(Event::ModifiersChanged(held));
    }

    fn button(&mut self, pos: Pos2, button: PointerButton, pressed: bool) {
        self.events.push(Event::PointerButton { pos, button, pressed, modifiers: self.held });
    }

    pub fn move_to(&mut self, at: Pos2) {
        self.events.push(Event::PointerMoved(at));
        self.frame();
    }

    /// Turns the wheel over a place until what lies there does not move any more.
    pub fn scroll(&mut self, at: Pos2, points: f32) {
        self.move_to(at);
        self.events.push(Event::MouseWheel {
            unit: egui::MouseWheelUnit::Point,
            delta: egui::vec2(0.0, points),
            phase: egui::TouchPhase::Move,
            modifiers: self.held,
        });
        self.frames(40);
    }

    pub fn press(&mut self, at: Pos2) {
        self.move_to(at);
        self.button(at, PointerButton::Primary, true);
        self.frame();
    }

    pub fn release(&mut self, at: Pos2) {
        self.button(at, PointerButton::Primary, false);
        self.frame();
    }

    pub fn click_at(&mut self, at: Pos2) {
        self.press(at);
        self.release(at);
        self.frame();
    }

    #[track_caller]
    pub fn click(&mut self, label: &str) {
        // Clicks that follow too soon would count as double clicks.
        self.time += 1.0;
        let at = self.find(label).rect.center();
        self.click_at(at);
    }

    #[track_caller]
    pub fn double_click(&mut self, label: &str) {
        self.click(label);
        let at = self.find(label).rect.center();
        self.press(at);
        self.release(at);
        self.frames(2);
    }

    #[track_caller]
    pub fn secondary_click(&mut self, label: &str) {
        let at = self.find(label).rect.center();
        self.secondary_click_at(at);
    }

    pub fn secondary_click_at(&mut self, at: Pos2) {
        self.move_to(at);
        self.button(at, PointerButton::Secondary, true);
        self.frame();
        self.button(at, PointerButton::Secondary, false);
        self.frame();
        self.frames(2);
    }

    /// Drags in eight steps.
    pub fn drag(&mut self, from: Pos2, to: Pos2) {
        self.time += 1.0;
        self.press(from);
        for step in 1..=8 {
            self.move_to(from.lerp(to, step as f32 / 8.0));
        }
        self.release(to);
        self.frames(2);
    }

    pub fn key(&mut self, key: Key) {
        for pressed in [true, false] {
            self.events.push(Event::Key { key, physical_key: None, pressed, repeat: false, modifiers: self.held });
        }
        self.frame();
        self.frame();
    }

    pub fn type_text(&mut self, text: &str) {
        self.events.push(Event::Text(text.to_owned()));
        self.frame();
    }

    pub fn edit(&mut self, operation: Operation) {
        self.app.world_mut().write_message(EditRequest::operation(self.rig, operation));
        self.app.update();
        self.frames(2);
    }

    /// Undoes that many steps, one after the other.
    pub fn undo(&mut self, count: usize) {
        for _ in 0..count {
            self.app.world_mut().write_message(EditRequest { rig: self.rig, change: Change::Undo });
            self.frames(3);
        }
    }

    /// A chain with these labels, one below the other, upwards from the rig's origin.
    pub fn chain(&mut self, labels: &[&str]) -> Vec<Uid> {
        let from = self.rig().len();
        let positions = (0..labels.len()).map(|number| Vec3::new(0.0, number as f32, 0.0)).collect();
        self.edit(Operation::Chain { positions, parent: None });
        let joints: Vec<Uid> = self.rig().walk().map(|joint| joint.data.uid).skip(from).collect();
        let labels = joints.iter().zip(labels).map(|(uid, label)| (*uid, (*label).to_owned()));
        self.edit(Operation::Labels(labels.collect()));
        joints
    }

    pub fn select(&mut self, joints: &[Uid]) {
        let what = Pick::Joints(joints.to_vec());
        self.app.world_mut().write_message(PickRequest { rig: self.rig, what, add: false });
        self.app.update();
        self.frames(2);
    }

    pub fn rig(&self) -> &Rig {
        self.app.world().get::<Rig>(self.rig).unwrap()
    }

    pub fn selected(&self) -> &[Uid] {
        &self.app.world().get::<Selection>(self.rig).unwrap().0
    }

    pub fn label(&self, joint: Uid) -> &str {
        self.rig().joint(joint).unwrap().data.label.as_deref().unwrap_or_default()
    }

    /// Modules of the tags of a joint, all of which are commands.
    pub fn modules(&self, joint: Uid) -> Vec<String> {
        let tags = self.rig().joint(joint).unwrap().data.tags.iter();
        tags.map(|tag| match &tag.kind {
            TagKind::Command { module, .. } => module.clone(),
            TagKind::Feature { name, .. } => panic!("{name} is no command"),
        })
        .collect()
    }

    pub fn parent(&self, joint: Uid) -> Option<Uid> {
        self.rig().joint(joint).unwrap().parent
    }

    /// Number of steps of the history, and of those in effect.
    pub fn steps(&self) -> (usize, usize) {
        let (steps, done) = self.app.world().get::<RigHistory>(self.rig).unwrap().steps();
        (steps.len(), done)
    }

    /// Does something that is one step or none: without one, what is saved is as before; with one, after its undo. Returns
    /// true if it was a step.
    #[track_caller]
    pub fn is_one_step(&mut self, what: &str, saved: impl Fn(&Self) -> String, act: impl FnOnce(&mut Self)) -> bool {
        let (before, (steps, done)) = (saved(self), self.steps());
        act(self);
        match self.steps().1 - done {
            0 => {
                assert_eq!((saved(self), self.steps()), (before, (steps, done)), "{what}");
                false
            }
            1 => {
                assert_ne!(saved(self), before, "{what}");
                self.undo(1);
                assert_eq!((saved(self), self.steps().1), (before, done), "{what}");
                true
            }
            more => panic!("{what} makes {more} steps"),
        }
    }

    pub fn told(&self) -> Vec<String> {
        let book = self.app.world().resource::<LogBook>();
        book.entries().map(|entry| entry.notice.text.clone()).collect()
    }
}

fn shown_widget(node: &accesskit::Node) -> Option<ShownWidget> {
    let bounds = node.bounds()?;
    let rect = Rect::from_min_max(
        egui::pos2(bounds.x0 as f32, bounds.y0 as f32),
        egui::pos2(bounds.x1 as f32, bounds.y1 as f32),
    );
    Some(ShownWidget {
        label: node.label().unwrap_or_default().to_owned(),
        value: node.value().unwrap_or_default().to_owned(),
        rect,
        on: node.toggled().map(|toggled| toggled == accesskit::Toggled::True),
        enabled: !node.is_disabled(),
        clickable: node.supports_action(accesskit::Action::Click) && node.supports_action(accesskit::Action::Focus),
    })
}
