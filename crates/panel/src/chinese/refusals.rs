//! Requests of pages that are not answered.

use takt::family::ChinesePhrase;

/// English and Chinese.
pub const PHRASES: &[ChinesePhrase] = &[
    (
        "{0} is not an address of this panel; open it by its address or by localhost, or start takt with --panel-origin",
        "{0} 不是本面板的地址；请用其地址或 localhost 打开，或启动 takt 时加上 --panel-origin",
    ),
    ("the request comes from a page of another site, {0}", "请求来自其他站点 {0} 的页面"),
    ("the panel needs its token", "面板需要令牌"),
    ("this is not the token of the panel", "令牌与本面板不符"),
    ("the header {0} is missing", "缺少请求头 {0}"),
    ("a command is application/json", "指令须为 application/json"),
    ("a command has at most {0} bytes", "指令最多 {0} 字节"),
    ("the command came too slowly", "指令传输过慢"),
    ("this is no command: <0>", "这不是有效指令：<0>"),
    ("stop categories are 0, 1 and 2", "停止类别只有 0、1、2"),
    ("{0} pages are open already; close one of them", "已打开 {0} 个页面，请关闭其中一个"),
    ("the connection of this page is lost; load it again", "本页面的连接已断开，请重新加载"),
    ("states do not reach this page at present, so it moves nothing", "状态数据暂未到达本页面，因此不能驱动"),
    ("this page does not command: <0>", "本页面没有控制权：<0>"),
    ("page {0} does; take over from it first", "页面 {0} 正在控制，请先接管"),
    ("take command first", "请先获取控制权"),
    ("too many commands: at most {0} a second are taken", "指令过于频繁：每秒最多接受 {0} 条"),
    ("a later command of this page has overtaken this one", "该指令已被本页面后来的指令取代"),
    // What commissioning refuses at once.
    ("node IDs are 1 to 127", "节点 ID 为 1 至 127"),
    ("readings come every {0} to {1} ms", "读数间隔为 {0} 至 {1} ms"),
    ("a frame is sent 1 to {0} times, every {1} to {2} ms", "一帧可发送 1 至 {0} 次，间隔 {1} 至 {2} ms"),
    // What is broken on purpose in the demonstration.
    ("there is no axis {0}", "没有轴 {0}"),
    ("nothing here is simulated", "此处没有仿真的驱动器"),
];

#[cfg(test)]
mod tests {
    use super::super::super::pages::PageRefusal;
    use super::super::tests::is_chinese;

    #[test]
    fn every_refusal_of_a_page_is_chinese() {
        for refusal in [
            PageRefusal::TooManyPages,
            PageRefusal::NotOpen,
            PageRefusal::NotPresent,
            PageRefusal::NotCommander { commander: Some(3) },
            PageRefusal::NotCommander { commander: None },
            PageRefusal::TooOften { per_second: 10 },
            PageRefusal::Overtaken,
        ] {
            is_chinese(&refusal.to_string());
        }
    }

    #[cfg(feature = "server")]
    #[test]
    fn every_refusal_of_a_request_is_chinese() {
        use super::super::super::access::Denied;
        use super::super::super::gate::Problematic;

        let host = "left".to_owned();
        for refusal in [
            Problematic::Denied(Denied::Host { host: host.clone() }),
            Problematic::Denied(Denied::Origin { origin: host }),
            Problematic::Denied(Denied::NoToken),
            Problematic::Denied(Denied::WrongToken),
            Problematic::NoHeader,
            Problematic::MediaType,
            Problematic::TooLarge,
            Problematic::TooSlow,
            Problematic::Malformed("node IDs are 1 to 127".to_owned()),
            Problematic::Malformed("stop categories are 0, 1 and 2".to_owned()),
            Problematic::Malformed("readings come every 20 to 5000 ms".to_owned()),
            Problematic::Malformed("a frame is sent 1 to 1000 times, every 10 to 10000 ms".to_owned()),
        ] {
            is_chinese(&refusal.told().2);
        }
    }
}
